"""Force, and what is left of the vein, against depth, at one place of a synthetic thigh."""
import sonde


def main(depths_mm=(2, 4, 6, 8, 10, 12)):
    leg = sonde.thigh()
    print("depth mm   force N   vein area   artery area")
    rows = []
    for depth in depths_mm:
        found = sonde.press(leg, leg.places["site 27"], depth_mm=depth)
        vein = found["vessels"]["femoral_vein"]["area_ratio"]
        artery = found["vessels"]["femoral_artery"]["area_ratio"]
        rows.append((depth, found["force_n"], vein, artery))
        print(f"{depth:8g} {found['force_n']:9.2f} {vein:11.3f} {artery:13.3f}")
    return rows


if __name__ == "__main__":
    main()
