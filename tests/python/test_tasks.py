"""Laws of the learners' tasks, with NumPy alone."""
import os
import sys
import tempfile
import unittest

import numpy as np
import sonde.tasks

import one_place

sys.path.insert(0, os.path.join(os.environ["SONDE_SOURCE"], "python", "examples"))


class Tasks(unittest.TestCase):
    def test_an_exam_can_be_won(self):
        with tempfile.TemporaryDirectory() as folder:
            task = sonde.tasks.ThreePointExam(images=False, **one_place.write(folder))
        task.reset(0, np.random.default_rng(2))
        seen = task.observation(0)
        total, firm = 0.0, seen["firm_n"][0]
        over = False
        for k in range(160):  # above the place, pressed for three seconds, let go, answered
            action = np.zeros(7, np.float32)
            action[:2] = np.clip(seen["target"][:2] / 0.01, -1, 1)
            action[2] = 2 * (firm if 20 < k < 110 else 0.1) / 25 - 1
            action[6] = -1 if k > 140 else 0
            rewards, ended = task.step(action[None], np.ones(1, bool))
            seen, over = task.observation(0), bool(ended[0])
            total += rewards[0]
            if over:
                break
        self.assertTrue(over)
        self.assertGreater(total, 8)  # a place, and a score of 70 and more

    def test_observations_lie_within_their_bounds(self):
        task = sonde.tasks.CompressVein(count=1)
        task.reset(0, np.random.default_rng(1))
        seen = task.observation(0)
        self.assertEqual(set(seen), set(task.bounds))
        for name, (low, high, shape, kind) in task.bounds.items():
            self.assertEqual((seen[name].shape, seen[name].dtype), (shape, np.dtype(kind)))
            self.assertTrue((seen[name] >= low).all() and (seen[name] <= high).all())

    def test_many_are_as_one(self):
        one = sonde.tasks.ReachVein(count=1, images=False)
        many = sonde.tasks.ReachVein(count=3, images=False)
        one.reset(0, np.random.default_rng(5))
        for i in range(3):
            many.reset(i, np.random.default_rng(5 if i == 1 else i))
        for k in range(6):
            action = np.array([0.2, 0.1, -0.6, 0, 0, 0.1])
            a, _ = one.step(action[None], np.ones(1, bool))
            b, _ = many.step(np.tile(action, (3, 1)), np.ones(3, bool))
            self.assertEqual(a[0], b[1])
        self.assertTrue(np.array_equal(one.wrench[0], many.wrench[1]))
        self.assertFalse(np.array_equal(one.wrench[0], many.wrench[0]))

    def test_the_learner_beats_one_who_holds_still(self):
        import learn_reach as learn
        long = bool(os.environ.get("SONDE_TEST_LONG"))
        task = sonde.tasks.ReachVein(count=4, steps=50 if long else 20)
        x, y = learn.collect(task, 120 if long else 50, np.random.default_rng(1))
        still, learned, known = (
            learn.succeed(task, 8 if long else 4, np.random.default_rng(2), policy) for policy in (
                lambda t, i: learn.towards(0.0),
                lambda t, i, w=learn.regress(x, y): learn.towards(learn.features(t.images[i]) @ w),
                lambda t, i: learn.towards(t.see(i, "vein_x_m"))))
        self.assertGreater(learned, still)
        self.assertGreaterEqual(known, learned)


if __name__ == "__main__":
    unittest.main()
