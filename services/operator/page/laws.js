// The menu of laws: another one in charge, while it drives.

import { $, hint } from "./dom.js";

/** Time between two looks who is in charge, and how many of them. */
const LOOK_MS = 50;
const LOOKS = 20;

/** `swap(law)` puts a law in charge and tells, when it is done, whether it worked; `inCharge()` names the one that is. */
export class Laws {
  constructor(swap, inCharge) {
    Object.assign(this, { swap, inCharge });
    this.menu = $("law");
    // Arrow keys go through the menu, and every law on the way would drive: keys choose, Enter swaps.
    this.byKey = false;
    this.menu.addEventListener("pointerdown", () => (this.byKey = false));
    this.menu.addEventListener("keydown", (event) => this.key(event));
    this.menu.addEventListener("change", () => (this.byKey ? hint(`Enter puts ${this.menu.value} in charge`, 0) : this.take()));
    this.menu.addEventListener("blur", () => (this.menu.value = this.inCharge() ?? this.menu.value));
  }

  set(laws) {
    const chosen = this.menu.value;
    this.menu.replaceChildren(...laws.map((law) => new Option(law, law)));
    if (laws.includes(chosen)) this.menu.value = chosen;
  }

  key(event) {
    this.byKey = true;
    if (event.key !== "Enter" || this.menu.value === this.inCharge()) return;
    event.preventDefault();
    this.take();
  }

  async take() {
    const law = this.menu.value;
    this.menu.dataset.busy = "yes";
    this.menu.disabled = true;
    hint(`${law} is being tried`, 0);
    const done = await this.swap(law);
    // What the robot says of itself comes a little later.
    for (let looks = 0; done && this.inCharge() !== law && looks < LOOKS; looks++) await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
    delete this.menu.dataset.busy;
    this.menu.disabled = false;
    this.menu.value = this.inCharge() ?? law;
  }
}
