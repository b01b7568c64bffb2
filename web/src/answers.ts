/** Answers about files, as flags of `ohmstrain import`. */

/** A word as a POSIX shell takes it. */
export function quoted(word: string): string {
  return /^[\w\-+=./:,@%]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

export class Answers {
  gaugeLength = "";
  rate = "";
  others = "";
  private readonly columns = new Map<string, string>();
  private readonly units = new Map<string, string>();

  /** The same, to say more of. */
  copy(): Answers {
    const one = new Answers();
    Object.assign(one, { gaugeLength: this.gaugeLength, rate: this.rate, others: this.others });
    for (const [role, column] of this.columns) one.columns.set(role, column);
    for (const [role, unit] of this.units) one.units.set(role, unit);
    return one;
  }

  /** A column, by its number, was taken for a role and is to be taken for another; for none if it is empty. */
  column(number: string, role: string, wanted: string): void {
    if (role !== "" && role !== wanted) this.columns.set(role, "none");
    if (wanted !== "") {
      this.columns.set(wanted, number);
      this.units.delete(wanted);
    }
  }

  /** The unit of a role's column. */
  unit(role: string, unit: string): void {
    this.units.set(role, unit);
  }

  /** An answer of the importer: flags, of which a column's and a unit's take the place of earlier ones. */
  answer(flags: string): void {
    const plain = /^--(column|unit) ([\w-]+)=(\S+)( or | if |$)/.exec(flags);
    if (plain?.[1] === "unit" && plain[2] && plain[3]) this.unit(plain[2], plain[3]);
    else this.others = `${this.others} ${flags.replace(/ \(or what is there\)$/, "")}`.trim();
  }

  flags(): string {
    const flags: string[] = [];
    for (const [role, column] of this.columns) flags.push(`--column ${quoted(`${role}=${column}`)}`);
    for (const [role, unit] of this.units) flags.push(`--unit ${quoted(`${role}=${unit}`)}`);
    if (this.gaugeLength !== "") flags.push(`--gauge-length-mm ${quoted(this.gaugeLength)}`);
    if (this.rate !== "") flags.push(`--rate-hz ${quoted(this.rate)}`);
    if (this.others !== "") flags.push(this.others);
    return flags.join(" ");
  }
}
