// Threads that bake: those of one bake are kept ready, since the page waits while one is made.

/** Threads in reserve. */
export class Reserve {
  private readonly spare: Worker[] = [];

  /** `code` is the address of the script, `n` the number of threads of a bake. */
  constructor(
    private readonly code: string,
    private readonly n: number,
  ) {
    this.fill();
  }

  /** Makes the threads of the next bake, unless they are there. */
  fill(): void {
    while (this.spare.length < this.n) this.spare.push(new Worker(this.code));
  }

  /** Returns a thread, for one bake. */
  take(): Worker {
    return this.spare.pop() ?? new Worker(this.code);
  }
}
