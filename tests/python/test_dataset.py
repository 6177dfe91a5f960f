"""A data set read with the standard library and NumPy, as its example does: masks lie on what the picture shows,
closure is what the labels say, strain and displacement are of the same tissue."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, os.path.join(os.environ["SONDE_SOURCE"], "python/examples"))
import read_dataset  # noqa: E402

try:
    import h5py
except ImportError:
    h5py = None

PLAN = """sonde_dataset: 1
body: bundled
seed: 5
legs: 1
presses: 1
frames: 2
width: 96
height: 96
clot_share: 0
station_share: 0
along_share: 0
contact_n: 1
force_low_n: 4
force_high_n: 4
"""


class DataSet(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "plan.yaml"), "w") as plan:
                plan.write(PLAN)
            subprocess.run([os.environ["SONDE_PROGRAM"], "dataset", "--plan", plan.name, "-o", folder + "/set"],
                           check=True, capture_output=True)
            cls.rows = read_dataset.main(folder + "/set")
            cls.frames = list(read_dataset.frames(folder + "/set"))
            cls.stacked = cls.read_hdf5(folder) if h5py else None

    @staticmethod
    def read_hdf5(folder):
        sets = []
        for name in ("one", "two"):
            made = subprocess.run([os.environ["SONDE_PROGRAM"], "dataset", "--plan", folder + "/plan.yaml",
                                   "--format", "hdf5", "-o", f"{folder}/{name}"], capture_output=True, text=True)
            if "without libhdf5" in made.stderr:
                return None
            sets.append(open(f"{folder}/{name}/leg-000000.h5", "rb").read())
        assert sets[0] == sets[1], "two runs made other bytes"
        with h5py.File(f"{folder}/one/leg-000000.h5") as file:
            return {name: file[name][()] for name in file}

    def test_members(self):
        self.assertEqual([f["key"] for f in self.frames], ["000000_00_00", "000000_00_01"])
        for f in self.frames:
            self.assertEqual({k: v.shape for k, v in f.items() if k not in ("key", "json")}, {
                "clot": (96, 96), "displacement": (96, 96, 3), "envelope": (1024, 192), "image": (96, 96),
                "strain": (96, 96, 6), "tissue": (96, 96), "vessel": (96, 96)})
            self.assertEqual(set(np.unique(f["clot"])), {0})

    def test_hdf5_holds_the_same(self):
        if self.stacked is None:
            self.skipTest("no h5py, or no libhdf5 in the program")
        for i, f in enumerate(self.frames):
            self.assertEqual(self.stacked["key"][i].decode(), f["key"])
            self.assertEqual(json.loads(self.stacked["json"][i]), f["json"])
            for name, value in f.items():
                if name not in ("key", "json"):
                    np.testing.assert_array_equal(self.stacked[name][i], value)

    def test_force_and_wrench(self):
        for f, force in zip(self.frames, (1, 4)):
            self.assertAlmostEqual(f["json"]["force_n"] / force, 1, delta=1e-3)
            self.assertAlmostEqual(f["json"]["wrench"][2], -f["json"]["force_n"], delta=1e-6)

    def test_labels_are_those_of_the_state(self):
        named = {}
        for pairs, _, _, _ in self.rows:
            for name, area, drawn, ratio in pairs:
                self.assertAlmostEqual(drawn / area, 1, delta=0.05, msg=name)
                named.setdefault(name, []).append(ratio)
        self.assertGreater(named["femoral_vein"][0], named["femoral_vein"][1] + 0.1)

    def test_lumen_is_dark(self):
        for _, (lumen, beside), _ in ((r[0], (r[1], r[2]), r[3]) for r in self.rows):
            self.assertLess(lumen, 0.7 * beside)

    def test_strain_keeps_the_volume_of_muscle(self):
        self.assertLess(self.rows[0][3], 0.01)
        self.assertLess(self.rows[1][3], 0.05)

    def test_strain_is_the_slope_of_the_displacement(self):
        # In small strain the slope along the depth, between rows of muscle, is zz.
        f = self.frames[0]
        u, e = f["displacement"].astype(float), f["strain"].astype(float)
        muscle = f["tissue"] == 3
        inner = muscle[2:] & muscle[1:-1] & muscle[:-2] & np.isfinite(e[1:-1, :, 2])
        slope = (u[2:, :, 2] - u[:-2, :, 2]) / (2e-3 * f["json"]["pixel_mm"])
        off = slope[inner] - e[1:-1, :, 2][inner]
        self.assertGreater(inner.sum(), 500)
        self.assertLess(np.median(np.abs(off)), 0.1 * np.median(np.abs(e[1:-1, :, 2][inner])))


if __name__ == "__main__":
    unittest.main()
