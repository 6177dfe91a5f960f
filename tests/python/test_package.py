"""Laws of the package for Python, on the bundled thigh."""
import gc
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import zipfile

import numpy as np
import sonde

SOURCE, BUILD = os.environ["SONDE_SOURCE"], os.environ["SONDE_BUILD"]
sys.path.insert(0, os.path.join(SOURCE, "python", "examples"))


def setUpModule():
    global leg
    leg = sonde.thigh()


class Package(unittest.TestCase):
    def test_press_says_what_the_program_says(self):
        found = sonde.press(leg, leg.places["site 27"], force_n=3)
        said = json.loads(subprocess.run(
            [os.environ["SONDE_PROGRAM"], "press", sonde.data_file("thigh.sonde"), "--site", "27",
             "--force-n", "3", "--json"], check=True, capture_output=True, text=True).stdout)
        # Each press settles to a residual of 1e-6 of its force, from poses that differ in rounding.
        self.assertAlmostEqual(found["force_n"], said["force_n"], delta=3e-6)
        self.assertAlmostEqual(found["depth_m"] * 1e3, said["penetration_mm"], places=5)
        self.assertAlmostEqual(found["vessels"]["femoral_vein"]["area_ratio"],
                               said["vein_area_ratio"], delta=0.02)  # breath and pulse
        self.assertLess(abs(found["force_n"] - 3), 1e-3)

    def test_views_are_the_batch_own_memory(self):
        batch = sonde.Batch(leg, count=2, size=(32, 48))
        images, pose = np.asarray(batch.images), np.asarray(batch.pose)
        self.assertEqual(images.shape, (2, 48, 32))
        self.assertEqual(images.__array_interface__["data"],
                         np.asarray(batch.images).__array_interface__["data"])
        self.assertFalse(images.flags.writeable)
        with self.assertRaises(ValueError):
            pose[0, 0] = 1
        before = pose.copy()
        actions = np.zeros((2, 7))
        actions[1, 0] = 0.1
        batch.step(actions)
        self.assertTrue(np.array_equal(pose[0], before[0]))
        self.assertAlmostEqual(np.linalg.norm(pose[1, :3] - before[1, :3]), 0.1 * 0.02, places=12)
        del batch
        gc.collect()
        self.assertTrue(np.isfinite(pose).all())  # the view keeps the batch alive

    def test_results_do_not_depend_on_threads(self):
        hashes = []
        for threads in (1, 2):
            batch = sonde.Batch(leg, count=3, drive="force", inside=False, threads=threads)
            for i in range(3):
                batch.reset(i, pose=leg.places["site 27"], stiffness=1 + 0.2 * i)
            actions = np.zeros((3, 7))
            actions[:, 2] = 4
            for _ in range(5):
                batch.step(actions)
            hashes.append((batch.hash(), np.asarray(batch.wrench).tobytes()))
        self.assertEqual(*hashes)
        forces = np.frombuffer(hashes[0][1]).reshape(3, 6)[:, 2]
        self.assertEqual(len(set(forces)), 3)

    def test_saved_environments_go_on_alike(self):
        batch = sonde.Batch(leg, count=2, drive="force", size=(32, 32))
        for i in range(2):
            batch.reset(i, pose=leg.places["site 27"])
        actions = np.zeros((2, 7))
        actions[:, 2] = 5, 2
        for _ in range(5):
            batch.step(actions)
        batch.restore(1, batch.save(0))
        actions[:, 2] = 6
        batch.step(actions)
        for rows in (batch.wrench, batch.vessel, batch.images):
            rows = np.asarray(rows)
            self.assertTrue(np.array_equal(rows[0], rows[1], equal_nan=rows.dtype != np.uint8))
        with self.assertRaises(ValueError):
            batch.restore(0, b"no environment")

    def test_bad_input_is_named(self):
        with self.assertRaisesRegex(ValueError, "224 bytes|112 bytes"):
            sonde.Batch(leg, count=2, inside=False).step(np.zeros((1, 7)))
        with self.assertRaisesRegex(ValueError, "ticks_per_step"):
            sonde.Batch(leg, ticks=0)
        with self.assertRaisesRegex(ValueError, "drive"):
            sonde.Batch(leg, drive="will")
        with self.assertRaises(LookupError):
            sonde.Batch(leg, probe="banana")
        with self.assertRaisesRegex(TypeError, "no parameter 'height'"):
            sonde.Leg.limb(3, height=2)
        with self.assertRaisesRegex(ValueError, "bmi"):
            sonde.Leg.limb(3, bmi=99)
        with self.assertRaises(OSError):
            sonde.Leg.load("/no/such/file.sonde")
        with self.assertRaisesRegex(ValueError, "7 numbers"):
            sonde.press(leg, (0, 0, 0), force_n=1)
        with self.assertRaisesRegex(ValueError, "either"):
            sonde.press(leg, leg.places["site 27"])
        with self.assertRaises(IndexError):
            sonde.Batch(leg, inside=False).reset(1)

    def test_fit_and_predict_a_table(self):
        data = os.path.join(SOURCE, "data", "thigh")
        fitted = sonde.fit(f"{data}/skin.ply", f"{data}/indentation.csv", f"{data}/sites.csv",
                           femur=f"{data}/femur.ply", stages=1)
        self.assertEqual(fitted["leg"].nodes, leg.nodes)
        self.assertEqual(len(fitted["sites"]), 64)
        self.assertEqual(fitted["parameters"], 256)
        self.assertLess(fitted["errors"]["mae_percent"], 2)
        rows = pathlib.Path(data, "indentation.csv").read_text().splitlines()
        with tempfile.NamedTemporaryFile("w", suffix=".csv") as few:
            head = next(r for r in rows if r.startswith("site,"))
            some = [r for r in rows if r.startswith("27,linear,")]
            few.write("\n".join([head, *some]) + "\n")
            few.flush()
            found = sonde.predict(leg, few.name)
        self.assertEqual(len(found["force_n"]), len(some))
        self.assertLess(found["errors"]["mae_percent"], 5)

    def test_limb_has_stations_and_skin(self):
        limb = sonde.Leg.limb(3, sex="female", bmi=24)
        self.assertIn("popliteal", limb.places)
        vertices, faces = map(np.asarray, limb.skin())
        self.assertEqual(len(vertices), limb.nodes)
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self.assertTrue((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())  # closed
        with tempfile.TemporaryDirectory() as folder:
            limb.save(os.path.join(folder, "limb.sonde"))
            again = sonde.Leg.load(os.path.join(folder, "limb.sonde"))
        self.assertEqual(again.places["popliteal"], limb.places["popliteal"])

    def test_examples_run(self):
        import many_legs
        import press
        rows = press.main(depths_mm=(3, 6))
        self.assertTrue(rows[1][1] > rows[0][1] > 0 and rows[1][2] < rows[0][2])
        closes = many_legs.main([leg], steps=50, most_n=12)
        self.assertTrue(4 < closes[0] < 10)

    def test_wheel_holds_the_package(self):
        subprocess.run(["cmake", "--build", BUILD, "--target", "wheel"], check=True,
                       capture_output=True)
        name = next(n for n in os.listdir(BUILD) if n.endswith(".whl"))
        self.assertRegex(name, r"^sonde-\d+\.\d+\.\d+-cp311-abi3-linux_")
        with tempfile.TemporaryDirectory() as folder:
            with zipfile.ZipFile(os.path.join(BUILD, name)) as wheel:
                wheel.extractall(folder)
            out = subprocess.run([sys.executable, "-c", "import sonde; print(sonde.thigh().nodes)"],
                                 env={"PYTHONPATH": folder}, check=True, capture_output=True,
                                 text=True).stdout
        self.assertEqual(int(out), leg.nodes)


if __name__ == "__main__":
    unittest.main()
