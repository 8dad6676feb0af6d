//! A killed run continues from its last checkpoint, bit by bit.

use clap::Parser;
use gleaner_host_trainer::env::site::Site;
use gleaner_host_trainer::keep::snapshot::{LAST, Snapshot};
use gleaner_host_trainer::learn::algorithm::Algorithm;
use gleaner_host_trainer::learn::run::{CHECKPOINT, OffPolicyRun};
use gleaner_host_trainer::learn::trainer::{TrainError, Trainer};
use gleaner_host_trainer::settings::Settings;
use gleaner_host_trainer::systems::{DdqnCgl, Gleaner, MosacAtt, MosacAttLayers, MosacCgl, MosacFtv};
use std::fs;
use std::path::Path;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    settings: Settings,
}

fn settings(more: &[&str]) -> Settings {
    let usual = ["train", "--warm-up", "200", "--replay", "400", "--batch", "4", "--share-rb", "0.3"];
    let shares = ["--share-rd", "0.3", "--share-varied", "0.5", "--share-greedy", "0.5", "--updates", "60"];
    Command::parse_from(usual.iter().chain(&shares).chain(more)).settings
}

fn open<A: Algorithm>(settings: Settings, folder: &Path) -> Result<OffPolicyRun<A>, TrainError> {
    OffPolicyRun::open(settings, Site::default_site(), folder)
}

fn check_resume<A: Algorithm>(settings: &Settings) {
    let (through, stopped) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut run = open::<A>(settings.clone(), through.path()).unwrap();
    while !run.is_done() {
        run.advance().unwrap();
    }
    run.save(through.path()).unwrap();

    let mut run = open::<A>(settings.clone(), stopped.path()).unwrap();
    for _ in 0..23 {
        run.advance().unwrap();
    }
    run.save(stopped.path()).unwrap();
    for _ in 0..5 {
        run.advance().unwrap(); // lost in the kill
    }
    drop(run);
    let mut run = open::<A>(settings.clone(), stopped.path()).unwrap();
    assert_eq!(run.update(), 23);
    while !run.is_done() {
        run.advance().unwrap();
    }
    run.save(stopped.path()).unwrap();

    let read = |folder: &tempfile::TempDir| fs::read(folder.path().join(CHECKPOINT)).unwrap();
    assert!(read(&through) == read(&stopped), "{}: the two runs differ", A::NAME);
}

#[test]
fn resumed_run_equals_an_uninterrupted_one() {
    check_resume::<Gleaner>(&settings(&[]));
    check_resume::<MosacAtt>(&settings(&[]));
    check_resume::<MosacAttLayers>(&settings(&[]));
    check_resume::<MosacCgl>(&settings(&[]));
    check_resume::<DdqnCgl>(&settings(&[]));
    check_resume::<MosacFtv>(&settings(&[]));
}

#[test]
fn resume_keeps_unfinished_n_step_returns() {
    let options =
        ["--n-step", "5", "--twin-minimum", "scalarised", "--heat-in-policy", "--pure-preferences", "0"];
    check_resume::<MosacFtv>(&settings(&options));
}

#[test]
fn folder_of_another_system_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    open::<DdqnCgl>(settings(&[]), folder.path()).unwrap().save(folder.path()).unwrap();
    let error = open::<MosacCgl>(settings(&[]), folder.path()).err().unwrap();
    assert!(matches!(&error, TrainError::OtherSystem { found, .. } if found == "ddqn-cgl"), "{error}");
    assert!(error.to_string().contains("--system ddqn-cgl"), "{error}");
}

#[test]
fn other_settings_are_refused_but_more_updates_are_not() {
    let folder = tempfile::tempdir().unwrap();
    open::<Gleaner>(settings(&[]), folder.path()).unwrap().save(folder.path()).unwrap();
    let error = open::<Gleaner>(settings(&["--discount", "0.9"]), folder.path()).err().unwrap();
    assert!(matches!(error, TrainError::OtherSettings { .. }), "{error}");
    let mut longer = settings(&[]);
    longer.updates = 90;
    assert!(open::<Gleaner>(longer, folder.path()).is_ok());
}

#[test]
fn checkpoint_leaves_the_last_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = open::<MosacFtv>(settings(&[]), folder.path()).unwrap();
    run.advance().unwrap();
    run.save(folder.path()).unwrap();
    let last = Snapshot::load(&folder.path().join(LAST)).unwrap().unwrap();
    assert_eq!((last.update, last.steps, last.system.as_str()), (1, run.steps(), "mosac-ftv"));
}

fn check_damage<A: Algorithm>() {
    let folder = tempfile::tempdir().unwrap();
    open::<A>(settings(&[]), folder.path()).unwrap().save(folder.path()).unwrap();
    let path = folder.path().join(CHECKPOINT);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let error = open::<A>(settings(&[]), folder.path()).err().unwrap().to_string();
    assert!(error.contains("damaged"), "{error}");
    assert_eq!(fs::read(&path).unwrap().len(), whole.len() / 2, "the damaged file is kept");
}

#[test]
fn damaged_checkpoint_is_refused_and_kept() {
    check_damage::<Gleaner>();
    check_damage::<MosacCgl>();
    check_damage::<DdqnCgl>();
    check_damage::<MosacFtv>();
}

#[test]
#[cfg(target_os = "linux")]
fn full_disk_keeps_the_last_good_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = open::<MosacFtv>(settings(&[]), folder.path()).unwrap();
    run.save(folder.path()).unwrap();
    let path = folder.path().join(CHECKPOINT);
    let good = fs::read(&path).unwrap();
    run.advance().unwrap();
    // /dev/full refuses every byte, as a full disk does.
    std::os::unix::fs::symlink("/dev/full", path.with_extension("writing")).unwrap();
    let error = run.save(folder.path()).err().unwrap().to_string();
    assert!(error.contains("No space left on device"), "{error}");
    assert!(fs::read(&path).unwrap() == good, "the last good checkpoint is unchanged");
    run.save(folder.path()).unwrap();
    assert!(fs::read(&path).unwrap() != good);
}
