"""The force that closes the vein of several legs at once: every probe presses a little harder in every step."""
import numpy as np
import sonde


def main(legs=None, steps=60, most_n=20.0):
    if legs is None:
        legs = [sonde.Leg.limb(seed, bmi=bmi) for seed, bmi in ((3, 20), (4, 25), (5, 30), (6, 35))]
    batch = sonde.Batch(legs, drive="force", friction=0.0)
    vessel, wrench = np.asarray(batch.vessel), np.asarray(batch.wrench)
    ratio = batch.vessel_names.index("vein_ratio")
    for i, leg in enumerate(legs):
        place = "common_femoral" if "common_femoral" in leg.places else "site 27"
        batch.reset(i, pose=leg.places[place])
    closes = np.full(batch.count, np.nan)
    actions = np.zeros((batch.count, 7))
    for k in range(steps):
        actions[:, 2] = most_n * (k + 1) / steps
        batch.step(actions)
        now = np.isnan(closes) & (vessel[:, ratio] < 0.1)
        closes[now] = -wrench[now, 2]
    for leg, force in zip(legs, closes):
        print(f"{leg.name:24} {leg.nodes:6d} nodes: vein closed at {force:5.1f} N")
    return closes


if __name__ == "__main__":
    main()
