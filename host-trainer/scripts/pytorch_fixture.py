"""Writes the results of the network in PyTorch, for `tests/pytorch_fixture.rs`.

    python3 host-trainer/scripts/pytorch_fixture.py

Needs torch. The committed fixture was written by torch 2.15.0 on a CPU. The encoder is PyTorch's
`nn.TransformerEncoderLayer`, padded to twelve devices with a mask, so that the packing of the Rust code is not
repeated here.

Parameters and inputs are not stored: both sides draw them from the generator below (xorshift64*, Vigna 2016).
`tests/fixtures/pytorch.f32` has sections of little-endian f32; `pytorch.json` lists them.
"""

import json
import math
import pathlib

import torch
from torch import nn

SEED = 0x9E3779B97F4A7C15
DEVICE_COUNTS = [6, 0, 12, 1, 3, 6, 9, 2, 10, 5, 6, 4, 7, 8, 11, 0, 6, 3, 12, 1]
DEVICES_MAX = 12
STEPS = 3
LEARNING_RATE = 3e-4
# Every 13th gradient and parameter is kept. The number is odd, so that every column of a matrix occurs.
STRIDE = 13


class Generator:
    """xorshift64*: uniform in [-1, 1), a whole multiple of 2^-23, exact in f32."""

    def __init__(self, seed):
        self.state = seed

    def number(self):
        mask = (1 << 64) - 1
        self.state ^= self.state >> 12
        self.state = (self.state ^ (self.state << 25)) & mask
        self.state ^= self.state >> 27
        return ((self.state * 0x2545F4914F6CDD1D & mask) >> 40) / 2**23 - 1.0

    def tensor(self, *size):
        count = math.prod(size)
        return torch.tensor([self.number() for _ in range(count)], dtype=torch.float32).reshape(size)


class Network(nn.Module):
    """The sections of the flat vector are the modules in the order of `flat_order`."""

    def __init__(self, cells, features, head, outputs):
        super().__init__()
        self.project_uav = nn.Linear(4, 64)
        self.project_preference = nn.Linear(2, 64)
        self.project_map = nn.Linear(cells, 64)
        self.project_device = nn.Linear(features, 64)
        self.encoder = nn.ModuleList(
            nn.TransformerEncoderLayer(64, 4, 128, dropout=0.0, batch_first=True, norm_first=False)
            for _ in range(2)
        )
        self.head = nn.ModuleList([nn.Linear(256, head), nn.Linear(head, outputs)])

    def flat_order(self):
        """(parameter, inputs of its linear layer, or None for a norm) in the order of the flat vector."""
        order = []

        def linear(weight, bias):
            order.extend([(weight, weight.shape[1]), (bias, weight.shape[1])])

        for module in [self.project_uav, self.project_preference, self.project_map, self.project_device]:
            linear(module.weight, module.bias)
        for layer in self.encoder:
            linear(layer.self_attn.in_proj_weight, layer.self_attn.in_proj_bias)
            linear(layer.self_attn.out_proj.weight, layer.self_attn.out_proj.bias)
            order.extend([(layer.norm1.weight, None), (layer.norm1.bias, None)])
            linear(layer.linear1.weight, layer.linear1.bias)
            linear(layer.linear2.weight, layer.linear2.bias)
            order.extend([(layer.norm2.weight, None), (layer.norm2.bias, None)])
        for module in self.head:
            linear(module.weight, module.bias)
        return order

    def draw(self, generator):
        """Linear layers uniform in +-1/sqrt(inputs); gains 1 +- 0.25, norm biases +-0.25."""
        with torch.no_grad():
            for parameter, inputs in self.flat_order():
                drawn = generator.tensor(*parameter.shape).double()
                if inputs is not None:
                    parameter.copy_((drawn / math.sqrt(inputs)).float())
                else:
                    gain = any(parameter is norm.weight for l in self.encoder for norm in (l.norm1, l.norm2))
                    parameter.copy_((drawn * 0.25 + (1.0 if gain else 0.0)).float())

    def forward(self, uav, preference, local_map, devices, absent):
        x = torch.cat(
            [
                self.project_uav(uav)[:, None],
                self.project_preference(preference)[:, None],
                self.project_map(local_map)[:, None],
                self.project_device(devices),
            ],
            dim=1,
        )
        hidden = torch.cat([torch.zeros(len(uav), 3, dtype=torch.bool), absent], dim=1)
        x = self.encoder[0](x, src_key_padding_mask=hidden)
        last = self.encoder[1].self_attn
        _, attention = last(x, x, x, key_padding_mask=hidden, need_weights=True)
        attention = attention.masked_fill(hidden[:, :, None], 0.0)
        x = self.encoder[1](x, src_key_padding_mask=hidden)
        pooled = x[:, 3:].masked_fill(absent[:, :, None], -torch.inf).amax(dim=1)
        pooled = torch.where(absent.all(dim=1)[:, None], 0.0, pooled)
        joined = torch.cat([x[:, 0], x[:, 1], x[:, 2], pooled], dim=1)
        return self.head[1](torch.relu(self.head[0](joined))), attention


def freeze(cells, features, head, outputs):
    """Sections of one network, in the order in which they are stored."""
    generator = Generator(SEED)
    network = Network(cells, features, head, outputs)
    network.draw(generator)
    count = len(DEVICE_COUNTS)
    uav, preference, local_map = generator.tensor(count, 4), generator.tensor(count, 2), generator.tensor(count, cells)
    devices = torch.zeros(count, DEVICES_MAX, features)
    absent = torch.ones(count, DEVICES_MAX, dtype=torch.bool)
    for sample, present in enumerate(DEVICE_COUNTS):
        devices[sample, :present] = generator.tensor(present, features)
        absent[sample, :present] = False
    targets = generator.tensor(count, outputs)

    parameters = [parameter for parameter, _ in network.flat_order()]
    assert sum(p.numel() for p in parameters) == sum(p.numel() for p in network.parameters())
    adam = torch.optim.Adam(parameters, lr=LEARNING_RATE)
    losses = []
    for step in range(STEPS):
        out, attention = network(uav, preference, local_map, devices, absent)
        loss = nn.functional.mse_loss(out, targets)
        adam.zero_grad()
        loss.backward()
        losses.append(loss.detach())
        if step == 0:
            logits, first_attention = out.detach(), attention.detach()
            gradients = torch.cat([p.grad.flatten() for p in parameters])
            norms = torch.stack([p.grad.norm() for p in parameters])
        adam.step()
    after = torch.cat([p.detach().flatten() for p in parameters])
    return {
        "outputs": logits,
        "attention": first_attention,
        "losses": torch.stack(losses),
        "gradient_norms": norms,
        "gradients": gradients[::STRIDE],
        "parameters_after": after[::STRIDE],
    }


def main():
    torch.set_num_threads(1)
    folder = pathlib.Path(__file__).parent.parent / "tests" / "fixtures"
    numbers, sections = [], {}
    # Numbers of the map, numbers of a device, width of the head, outputs.
    for name, sizes in [("actor", (81, 7, 64, 5)), ("critic", (81, 7, 64, 10)), ("paper", (100, 5, 128, 5))]:
        for section, tensor in freeze(*sizes).items():
            sections[f"{name}.{section}"] = [sum(len(n) for n in numbers), tensor.numel()]
            numbers.append(tensor.flatten())
    torch.cat(numbers).numpy().astype("<f4").tofile(folder / "pytorch.f32")
    manifest = {
        "torch": torch.__version__.split("+")[0],
        "seed": str(SEED),
        "device_counts": DEVICE_COUNTS,
        "steps": STEPS,
        "learning_rate": LEARNING_RATE,
        "stride": STRIDE,
        "sections": sections,
    }
    (folder / "pytorch.json").write_text(json.dumps(manifest, indent=1) + "\n")


if __name__ == "__main__":
    main()
