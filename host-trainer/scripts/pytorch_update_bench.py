"""Measures one update in PyTorch's eager mode, for comparison with `benches/update_ms.rs`.

    python3 host-trainer/scripts/pytorch_update_bench.py [rounds]

One thread, 96 samples of nine tokens (six devices, no padding), the same work: three forward passes for the targets,
forward and backward passes of two critics and the actor, three Adam steps, two Polyak steps. PyTorch uses its fastest
eager functions: scaled_dot_product_attention, fused Adam, foreach Polyak, no mask. Prints the minimum over the rounds,
in CPU and wall-clock milliseconds. Needs torch.
"""

import sys
import time

import torch
from torch import nn
from torch.nn import functional as F

SAMPLES, DEVICES, ACTIONS, OBJECTIVES = 96, 6, 5, 2
WARM_UP, PER_ROUND = 5, 5


class Layer(nn.Module):
    def __init__(self):
        super().__init__()
        self.qkv, self.out = nn.Linear(64, 192), nn.Linear(64, 64)
        self.ff1, self.ff2 = nn.Linear(64, 128), nn.Linear(128, 64)
        self.norm1, self.norm2 = nn.LayerNorm(64), nn.LayerNorm(64)

    def forward(self, x):
        q, k, v = self.qkv(x).unflatten(2, (3, 4, 16)).permute(2, 0, 3, 1, 4)
        mixed = F.scaled_dot_product_attention(q, k, v).transpose(1, 2).flatten(2)
        x = self.norm1(x + self.out(mixed))
        return self.norm2(x + self.ff2(torch.relu(self.ff1(x))))


class Network(nn.Module):
    def __init__(self, outputs):
        super().__init__()
        self.uav, self.preference = nn.Linear(4, 64), nn.Linear(2, 64)
        self.map, self.device = nn.Linear(81, 64), nn.Linear(7, 64)
        self.encoder = nn.Sequential(Layer(), Layer())
        self.head = nn.Sequential(nn.Linear(256, 64), nn.ReLU(), nn.Linear(64, outputs))

    def forward(self, sample):
        uav, preference, local_map, devices = sample
        fixed = [self.uav(uav), self.preference(preference), self.map(local_map)]
        x = self.encoder(torch.cat([torch.stack(fixed, 1), self.device(devices)], 1))
        return self.head(torch.cat([x[:, :3].flatten(1), x[:, 3:].amax(1)], 1))


def batch():
    sizes = [(SAMPLES, 4), (SAMPLES, 2), (SAMPLES, 81), (SAMPLES, DEVICES, 7)]
    return [torch.rand(*size) for size in sizes]


def learner(compiled=False):
    """Returns a function that makes one update; `compiled` has the networks compiled by TorchInductor."""
    actor = Network(ACTIONS)
    critics = [Network(ACTIONS * OBJECTIVES) for _ in range(2)]
    targets = [Network(ACTIONS * OBJECTIVES) for _ in range(2)]
    for target, critic in zip(targets, critics):
        target.load_state_dict(critic.state_dict())
    if compiled:
        for network in [actor, *critics, *targets]:
            network.compile(dynamic=False)
    adams = [torch.optim.Adam(net.parameters(), lr=1e-4, fused=True) for net in [actor, *critics]]
    before, after = batch(), batch()
    action = torch.randint(ACTIONS, (SAMPLES,))
    reward, going_on = torch.rand(SAMPLES, OBJECTIVES), (torch.rand(SAMPLES, 1) > 0.1).float()
    weight, nu = before[1][:, None, :], 0.1

    def update():
        with torch.no_grad():
            log_policy = torch.log_softmax(actor(after), 1)[:, :, None]
            lower = torch.minimum(*[t(after).view(SAMPLES, ACTIONS, OBJECTIVES) for t in targets])
            expected = (log_policy.exp() * (lower - nu * log_policy)).sum(1)
            goal = reward + 0.99 * going_on * expected
        values = []
        for critic, adam in zip(critics, adams[1:]):
            q = critic(before).view(SAMPLES, ACTIONS, OBJECTIVES)
            adam.zero_grad()
            F.mse_loss(q[torch.arange(SAMPLES), action], goal).backward()
            adam.step()
            values.append(q.detach())
        log_policy = torch.log_softmax(actor(before), 1)
        scalar = (weight * torch.minimum(*values)).sum(2)
        adams[0].zero_grad()
        (log_policy.exp() * (nu * log_policy - scalar)).sum(1).mean().backward()
        adams[0].step()
        with torch.no_grad():
            for target, critic in zip(targets, critics):
                torch._foreach_lerp_(list(target.parameters()), list(critic.parameters()), 0.005)

    return update


def main():
    torch.set_num_threads(1)
    torch.manual_seed(1)
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    update = learner()
    for _ in range(WARM_UP):
        update()
    cpu_ms, wall_ms = [], []
    for _ in range(rounds):
        cpu, wall = time.process_time(), time.perf_counter()
        for _ in range(PER_ROUND):
            update()
        cpu_ms.append((time.process_time() - cpu) / PER_ROUND * 1e3)
        wall_ms.append((time.perf_counter() - wall) / PER_ROUND * 1e3)
    print(f"pytorch {torch.__version__} cpu_ms {min(cpu_ms):.2f} wall_ms {min(wall_ms):.2f}")


if __name__ == "__main__":
    main()
