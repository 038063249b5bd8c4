// What a page keeps so as not to load it again: the least recently used leaves first.

export class Kept<T> {
  /** In the order of their last use, the oldest first. */
  private readonly entries = new Map<string, { value: T; bytes: number }>();
  private bytes = 0;

  constructor(
    private readonly bytesMax: number,
    private readonly onDrop: (value: T) => void = () => {},
  ) {}

  get(id: string): T | undefined {
    const entry = this.entries.get(id);
    if (entry === undefined) return undefined;
    this.entries.delete(id);
    this.entries.set(id, entry);
    return entry.value;
  }

  /** Keeps a value, and drops others until all fit; the newest one stays, however large. */
  set(id: string, value: T, bytes: number): void {
    this.forget(id);
    this.entries.set(id, { value, bytes });
    this.bytes += bytes;
    for (const [oldest, entry] of this.entries) {
      if (this.bytes <= this.bytesMax || oldest === id) break;
      this.forget(oldest);
      this.onDrop(entry.value);
    }
  }

  /** Removes a value without dropping it. */
  forget(id: string): void {
    this.bytes -= this.entries.get(id)?.bytes ?? 0;
    this.entries.delete(id);
  }

  get size(): number {
    return this.entries.size;
  }
}
