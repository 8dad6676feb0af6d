//! A killed run goes on exactly where its last checkpoint was.

use clap::Parser;
use gleaner_host_trainer::learn::learner::{DdqnCgl, Gleaner, Learner, MosacAtt, MosacCgl, MosacFtv};
use gleaner_host_trainer::learn::learning::Learning;
use gleaner_host_trainer::learn::run::{CHECKPOINT, Run, TrainError};
use gleaner_host_trainer::learn::settings::Settings;
use gleaner_host_trainer::systems::System;
use std::fs;

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

fn resumes<L: Learner>() {
    let (through, stopped) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut run = Run::<L>::open(settings(&[]), through.path()).unwrap();
    while !run.is_done() {
        run.advance().unwrap();
    }
    run.save(through.path()).unwrap();

    let mut run = Run::<L>::open(settings(&[]), stopped.path()).unwrap();
    for _ in 0..23 {
        run.advance().unwrap();
    }
    run.save(stopped.path()).unwrap();
    for _ in 0..5 {
        run.advance().unwrap(); // lost in the kill
    }
    drop(run);
    let mut run = Run::<L>::open(settings(&[]), stopped.path()).unwrap();
    assert_eq!(run.update(), 23);
    while !run.is_done() {
        run.advance().unwrap();
    }
    run.save(stopped.path()).unwrap();

    let read = |folder: &tempfile::TempDir| fs::read(folder.path().join(CHECKPOINT)).unwrap();
    assert!(read(&through) == read(&stopped), "{}: the two runs differ", L::SYSTEM);
}

#[test]
fn resuming_gives_the_same_bits_as_never_having_stopped() {
    resumes::<Gleaner>();
    resumes::<MosacAtt>();
    resumes::<MosacCgl>();
    resumes::<DdqnCgl>();
    resumes::<MosacFtv>();
}

#[test]
fn a_folder_with_a_run_of_another_system_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    Run::<DdqnCgl>::open(settings(&[]), folder.path()).unwrap().save(folder.path()).unwrap();
    let error = Run::<MosacCgl>::open(settings(&[]), folder.path()).err().unwrap();
    assert!(matches!(error, TrainError::OtherSystem { found: System::DdqnCgl, .. }), "{error}");
    assert!(error.to_string().contains("--system ddqn-cgl"), "{error}");
}

#[test]
fn a_folder_with_another_run_is_refused_and_a_longer_run_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::<Gleaner>::open(settings(&[]), folder.path()).unwrap();
    run.save(folder.path()).unwrap();
    let error = Run::<Gleaner>::open(settings(&["--discount", "0.9"]), folder.path()).err().unwrap();
    assert!(matches!(error, TrainError::OtherSettings { .. }), "{error}");
    let mut longer = settings(&[]);
    longer.updates = 90;
    assert!(Run::<Gleaner>::open(longer, folder.path()).is_ok());
}

fn notices_damage<L: Learner>() {
    let folder = tempfile::tempdir().unwrap();
    Run::<L>::open(settings(&[]), folder.path()).unwrap().save(folder.path()).unwrap();
    let path = folder.path().join(CHECKPOINT);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let error = Run::<L>::open(settings(&[]), folder.path()).err().unwrap().to_string();
    assert!(error.contains("damaged"), "{error}");
    assert_eq!(fs::read(&path).unwrap().len(), whole.len() / 2, "the evidence is untouched");
}

#[test]
fn a_damaged_checkpoint_is_refused_and_kept() {
    notices_damage::<Gleaner>();
    notices_damage::<MosacCgl>();
    notices_damage::<DdqnCgl>();
    notices_damage::<MosacFtv>();
}

#[cfg(target_os = "linux")]
fn survives_a_full_disk<L: Learner>() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::<L>::open(settings(&[]), folder.path()).unwrap();
    run.save(folder.path()).unwrap();
    let path = folder.path().join(CHECKPOINT);
    let good = fs::read(&path).unwrap();
    run.advance().unwrap();
    // What cannot be written through stands for a full disk: every byte sent there is refused for want of space.
    std::os::unix::fs::symlink("/dev/full", path.with_extension("writing")).unwrap();
    let error = run.save(folder.path()).err().unwrap().to_string();
    assert!(error.contains("No space left on device"), "{error}");
    assert!(fs::read(&path).unwrap() == good, "the last good checkpoint is untouched");
    // With room again, the run goes on as if nothing had happened.
    run.save(folder.path()).unwrap();
    assert!(fs::read(&path).unwrap() != good);
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_said_and_never_destroys_the_last_good_checkpoint() {
    survives_a_full_disk::<Gleaner>();
    survives_a_full_disk::<MosacCgl>();
    survives_a_full_disk::<DdqnCgl>();
    survives_a_full_disk::<MosacFtv>();
}
