"""A policy in PyTorch that Gleaner can fly: the network's contract and its export. Nothing is trained here.

    python pytorch_policy.py exported.onnx
    gleaner seal exported.onnx --out policy.onnx --name mine
    gleaner run --model policy.onnx ...

The contract, with N observations in a batch and everything in physical units:

    uav          [N, 4]       spare battery, battery (units), terminal east, north (m)
    devices      [N, 12, 7]   east, north (m), remaining data (units), SNR (dB), reachable (0 or 1), vantage east, north (m)
    device_mask  [N, 12]      1 for a device, 0 for an empty row
    preference   [N, 2]       weight of data, weight of energy
    local_map    [N, 81]      data units of a stay in each of 9 x 9 patches, south-west first
    logits       [N, 5]       hover, north, west, south, east
    attention    [N, 15, 15]  aircraft, preference, map, 12 devices; rows sum to 1

Normalisation is part of the graph, so that no program can do it wrongly. `gleaner seal` checks names and shapes, runs the
model twice on the observations of the built-in model, and adds the golden pairs that every start verifies.
"""

import sys

import torch
from torch import nn

DEVICES, TOKENS, WIDTH, ACTIONS = 12, 15, 64, 5


class Policy(nn.Module):
    """One attention layer over the tokens, the maximum over them, and a linear layer to the logits."""

    def __init__(self):
        super().__init__()
        # One row of scales for each kind of token: units, metres and decibels become numbers around 1.
        self.register_buffer("uav_scale", torch.tensor([100.0, 100.0, 400.0, 400.0]))
        self.register_buffer("device_scale", torch.tensor([400.0, 400.0, 8000.0, 30.0, 1.0, 400.0, 400.0]))
        self.map_scale = 8000.0
        self.uav = nn.Linear(4, WIDTH)
        self.device = nn.Linear(7, WIDTH)
        self.preference = nn.Linear(2, WIDTH)
        self.map = nn.Linear(81, WIDTH)
        self.query, self.key, self.value = (nn.Linear(WIDTH, WIDTH) for _ in range(3))
        self.logits = nn.Linear(2 * WIDTH, ACTIONS)

    def forward(self, uav, devices, device_mask, preference, local_map):
        own = self.uav(uav / self.uav_scale)
        tokens = torch.cat(
            [
                own.unsqueeze(1),
                self.preference(preference).unsqueeze(1),
                self.map(local_map / self.map_scale).unsqueeze(1),
                self.device(devices / self.device_scale),
            ],
            dim=1,
        )
        # Rows of absent devices may hold anything: they get no attention.
        present = torch.cat([torch.ones_like(device_mask[:, :3]), device_mask], dim=1)
        scores = self.query(tokens) @ self.key(tokens).transpose(1, 2) / WIDTH**0.5
        scores = scores + (present.unsqueeze(1) - 1.0) * 1e9
        attention = torch.softmax(scores, dim=2)
        seen = torch.relu(attention @ self.value(tokens)).amax(dim=1)
        return self.logits(torch.cat([own, seen], dim=1)), attention


def export(path):
    """Writes the network as it is."""
    torch.manual_seed(0)
    inputs = {
        "uav": torch.ones(1, 4),
        "devices": torch.ones(1, DEVICES, 7),
        "device_mask": torch.ones(1, DEVICES),
        "preference": torch.full((1, 2), 0.5),
        "local_map": torch.ones(1, 81),
    }
    outputs = ["logits", "attention"]
    batch = {name: {0: "N"} for name in [*inputs, *outputs]}
    torch.onnx.export(
        Policy().eval(),
        tuple(inputs.values()),
        path,
        input_names=list(inputs),
        output_names=outputs,
        dynamic_axes=batch,
        opset_version=17,
        dynamo=False,
    )


if __name__ == "__main__":
    export(sys.argv[1] if len(sys.argv) > 1 else "exported.onnx")
