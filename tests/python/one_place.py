"""A healthy case on the bundled thigh and a protocol of one place, as files."""
import os
import pathlib

CASE = """
sonde_case: 2
id: gym
title: A thigh for the test
level: first
history: Made for a test.
note: Made for a test.
thigh: bundled
truth:
  thrombosis: false
  diagnosis: No deep vein thrombosis
  segments: {common_femoral: compressible, femoral_proximal: compressible, femoral_mid: compressible,
    femoral_distal: compressible, popliteal: compressible}
"""
PROTOCOL = """
sonde_protocol: 1
id: one
title: One place
text: Made for a test.
places:
- title: Femoral vein
  text: Press.
  at: {segment: femoral_mid, share: 0.5}
"""


def write(folder: str) -> dict[str, str]:
    """Files in a folder, as arguments of the examination."""
    case, protocol = os.path.join(folder, "case.yaml"), os.path.join(folder, "protocol.yaml")
    pathlib.Path(case).write_text(CASE)
    pathlib.Path(protocol).write_text(PROTOCOL)
    return {"case": case, "protocol": protocol}
