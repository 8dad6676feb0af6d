"""Writes the results of the networks of the paper's baselines in PyTorch, for `tests/pytorch_fixture.rs`.

    python3 host-trainer/scripts/pytorch_fixture_baselines.py

Needs torch. The committed fixture was written by torch 2.15.0 on a CPU. The convolutions are PyTorch's `nn.Conv2d`,
every sample has its own maps, and state and preference enter the first layer as one vector, so that the unfolding and
sharing of the Rust code is not repeated here. `pytorch_fixture.py` documents how numbers are drawn and stored.
"""

import json
import math
import pathlib

import torch
from torch import nn

from pytorch_fixture import LEARNING_RATE, SEED, STEPS, Generator

# Number of preferences of each state.
COPIES = [3, 1, 0, 2, 1, 3, 3, 1, 1, 2, 1]
STRIDE = 29
LOCAL, GLOBAL, CHANNELS, FILTERS, KERNEL, HIDDEN = (10, 10), (11, 15), 4, 16, 5, 256
VECTOR = 64


class Head(nn.Module):
    def __init__(self, latent, outputs):
        super().__init__()
        self.latent = latent
        self.layers = nn.ModuleList([nn.Linear(latent + 2, HIDDEN), nn.Linear(HIDDEN, HIDDEN), nn.Linear(HIDDEN, outputs)])

    def forward(self, latent, preference):
        first, second, last = self.layers
        hidden = torch.relu(second(torch.relu(first(torch.cat([latent, preference], 1)))))
        return last(hidden)

    def flat_order(self):
        """(how to see the part of the parameter, inputs by which it is scaled) in the order of the flat vector."""
        first, second, last = self.layers
        order = [
            (lambda of: of(first.weight)[:, : self.latent], self.latent),
            (lambda of: of(first.bias), self.latent),
            (lambda of: of(first.weight)[:, self.latent :], 2),
        ]
        for layer in (second, last):
            order.append((lambda of, layer=layer: of(layer.weight), HIDDEN))
            order.append((lambda of, layer=layer: of(layer.bias), HIDDEN))
        return order


class Maps(nn.Module):
    def __init__(self, outputs):
        super().__init__()
        self.branches = nn.ModuleList(
            nn.ModuleList([nn.Conv2d(CHANNELS, FILTERS, KERNEL), nn.Conv2d(FILTERS, FILTERS, KERNEL)]) for _ in range(2)
        )
        places = sum((h - 2 * (KERNEL - 1)) * (w - 2 * (KERNEL - 1)) for h, w in (LOCAL, GLOBAL))
        self.head = Head(places * FILTERS + 1, outputs)

    def forward(self, state, preference):
        *maps, battery = state
        parts = []
        for (first, second), image in zip(self.branches, maps):
            # In maps and flattened vectors the channels of a cell are adjacent.
            out = torch.relu(second(torch.relu(first(image.permute(0, 3, 1, 2)))))
            parts.append(out.permute(0, 2, 3, 1).flatten(1))
        return self.head(torch.cat([*parts, battery], 1), preference)

    def flat_order(self):
        order = []
        for branch in self.branches:
            for conv in branch:
                inputs = KERNEL * KERNEL * conv.in_channels
                order.append((lambda of, conv=conv: of(conv.weight).permute(0, 2, 3, 1), inputs))
                order.append((lambda of, conv=conv: of(conv.bias), inputs))
        return order + self.head.flat_order()

    @staticmethod
    def states(generator, count):
        local, large = (generator.tensor(count, *size, CHANNELS) for size in (LOCAL, GLOBAL))
        return [local, large, generator.tensor(count, 1)]


class Vector(nn.Module):
    def __init__(self, outputs):
        super().__init__()
        self.head = Head(VECTOR, outputs)

    def forward(self, state, preference):
        return self.head(*state, preference)

    def flat_order(self):
        return self.head.flat_order()

    @staticmethod
    def states(generator, count):
        return [generator.tensor(count, VECTOR)]


def freeze(network, outputs):
    """Sections of one network, in the order in which they are stored."""
    generator = Generator(SEED)
    order = network.flat_order()
    with torch.no_grad():
        for view, inputs in order:
            part = view(lambda parameter: parameter)
            part.copy_((generator.tensor(*part.shape).double() / math.sqrt(inputs)).float())
    flat = lambda of: torch.cat([view(of).flatten() for view, _ in order])
    assert flat(lambda p: p).numel() == sum(p.numel() for p in network.parameters())
    states = [part.repeat_interleave(torch.tensor(COPIES), 0) for part in network.states(generator, len(COPIES))]
    preference = generator.tensor(sum(COPIES), 2)
    targets = generator.tensor(sum(COPIES), outputs)
    adam = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
    losses = []
    for step in range(STEPS):
        out = network(states, preference)
        loss = nn.functional.mse_loss(out, targets)
        adam.zero_grad()
        loss.backward()
        losses.append(loss.detach())
        if step == 0:
            first = out.detach()
            gradients = flat(lambda p: p.grad)
            norms = torch.stack([view(lambda p: p.grad).norm() for view, _ in order])
        adam.step()
    return {
        "outputs": first,
        "losses": torch.stack(losses),
        "gradient_norms": norms,
        "gradients": gradients[::STRIDE],
        "parameters_after": flat(lambda p: p.detach())[::STRIDE],
    }


def main():
    torch.set_num_threads(1)
    folder = pathlib.Path(__file__).parent.parent / "tests" / "fixtures"
    numbers, sections = [], {}
    for name, network, outputs in [("maps", Maps(10), 10), ("vector", Vector(5), 5)]:
        for section, tensor in freeze(network, outputs).items():
            sections[f"{name}.{section}"] = [sum(len(n) for n in numbers), tensor.numel()]
            numbers.append(tensor.flatten())
    torch.cat(numbers).numpy().astype("<f4").tofile(folder / "pytorch_baselines.f32")
    manifest = {
        "torch": torch.__version__.split("+")[0],
        "seed": str(SEED),
        "copies": COPIES,
        "steps": STEPS,
        "learning_rate": LEARNING_RATE,
        "stride": STRIDE,
        "sections": sections,
    }
    (folder / "pytorch_baselines.json").write_text(json.dumps(manifest, indent=1) + "\n")


if __name__ == "__main__":
    main()
