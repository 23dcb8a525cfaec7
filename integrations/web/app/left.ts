// How long a bake will still take, from the shares that its stages had in other buildings.

/** Shares of the time by stage, in any unit. Stages of other methods than the usual one are not here. */
const SHARES: Record<string, number> = {
  reading: 3, structure: 8, voxelize: 10, distance: 9, flood: 6, 'merge basins': 16, 'fit candidates': 5, 'cell complex': 22,
  'cells and portals': 10, 'hand out geometry': 5, plan: 6,
};
/** Less than this is not told: the beginning says little. [Units: share, s] */
const [FIRST, SOON] = [0.12, 1];

/** An estimate of what is left. */
export class Left {
  private readonly began = performance.now();
  private done = 0;
  private current = 0;
  private at = this.began;

  /** Hears that a stage begins. */
  begin(stage: string): void {
    this.done += this.current;
    this.current = SHARES[stage] ?? 0;
    this.at = performance.now();
  }

  /** Returns the seconds that are left, or `undefined` if that is not known yet. */
  seconds(): number | undefined {
    const sum = Object.values(SHARES).reduce((a, b) => a + b, 0);
    const passed = (this.at - this.began) / 1000;
    if (this.current === 0 || this.done < FIRST * sum || passed < SOON) return undefined;
    const whole = passed / (this.done / sum);
    // A stage that takes longer than it should leaves what comes after it.
    const after = (whole * (sum - this.done - this.current)) / sum;
    return Math.max(after, whole - (performance.now() - this.began) / 1000);
  }
}
