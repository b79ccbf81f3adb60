// Several pictures on their way through the service: a few at once, each with its state, each can be cancelled.

const AT_ONCE = 3;

export class Queue {
  #waiting = [];
  #running = new Set();

  /** `work(item, signal, onJob)` does one; `changed(item)` is called whenever an item's state is another. An item gets
   *  `state`: waiting, running, done, failed or cancelled, `progress` and `job`. */
  constructor(work, changed, cancelJob) {
    Object.assign(this, { work, changed, cancelJob });
  }

  get busy() {
    return this.#running.size + this.#waiting.length > 0;
  }

  add(items) {
    for (const item of items) {
      this.#drop(item);
      Object.assign(item, { state: "waiting", progress: null, problem: null, job: null });
      this.#waiting.push(item);
      this.changed(item);
    }
    this.#start();
  }

  /** Ends one item, wherever it is; its job is cancelled at the service. */
  cancel(item) {
    if (item.state !== "waiting" && item.state !== "running") return;
    this.#drop(item);
    item.state = "cancelled";
    if (item.job) this.cancelJob(item.job.id).catch(() => {}); // it may have ended by itself
    this.changed(item);
    this.#start();
  }

  #drop(item) {
    item.controller?.abort();
    item.controller = null;
    this.#waiting = this.#waiting.filter((other) => other !== item);
    this.#running.delete(item);
  }

  #start() {
    while (this.#running.size < AT_ONCE && this.#waiting.length) this.#run(this.#waiting.shift());
  }

  async #run(item) {
    const controller = (item.controller = new AbortController());
    this.#running.add(item);
    item.state = "running";
    this.changed(item);
    const onJob = (job) => {
      if (controller.signal.aborted) return;
      Object.assign(item, { job, progress: job.progress });
      this.changed(item);
    };
    let [state, problem] = ["done", null];
    try {
      await this.work(item, controller.signal, onJob);
    } catch (error) {
      [state, problem] = ["failed", error];
    }
    if (controller.signal.aborted) return;
    Object.assign(item, { state, problem });
    this.#running.delete(item);
    this.changed(item);
    this.#start();
  }
}
