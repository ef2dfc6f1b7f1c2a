/** The mission's past as a slider: map, plan, images and figures of any moment, or as a film; and the way back. */
import { clock, element, fixed, setText } from "../format.js";
import { Part } from "../observable.js";
import { report, store } from "../store.js";
import { timeline } from "../timeline.js";

class TimeLine extends Part {
  connectedCallback() {
    this.play = element("button", { type: "button", id: "play" });
    this.play.addEventListener("click", () => (timeline.playing ? timeline.pause() : timeline.play()));
    this.slider = element("input", {
      type: "range",
      id: "timeline-slider",
      min: 0,
      step: 1,
      "aria-label": "Moment of the mission",
    });
    this.slider.addEventListener("input", () => this.#go(Number(this.slider.value)));
    this.slider.addEventListener("keydown", (event) => this.#key(event));
    this.text = element("span", { id: "timeline-text", class: "text" });
    this.live = element("button", { type: "button", id: "go-live" });
    this.live.addEventListener("click", () => timeline.goLive());
    this.append(this.play, this.slider, this.text, this.live);
    this.follow(timeline, ["moments", "moment", "playing"], () => this.#draw());
    this.follow(store, ["mission"], () => this.#draw());
  }

  #go(place) {
    timeline.pause();
    // The newest moment of a mission that goes on is the present.
    if (store.active && place >= timeline.moments.length - 1) timeline.goLive();
    else timeline.go(place).catch(report);
  }

  #key(event) {
    if (event.key === "Escape") timeline.goLive();
    else if (event.key === " ") {
      event.preventDefault();
      this.play.click();
    }
  }

  #draw() {
    const { moments, moment, playing } = timeline;
    const none = moments.length === 0;
    const last = Math.max(0, moments.length - 1);
    this.slider.max = last;
    this.slider.value = moment ? timeline.place : last;
    this.slider.disabled = none;
    this.play.disabled = none;
    setText(this.play, playing ? "❚❚" : "▶");
    this.play.setAttribute("aria-label", playing ? "Pause the film" : "Play the mission from here");
    this.play.title = this.play.getAttribute("aria-label");
    setText(this.text, this.#words());
    this.slider.setAttribute("aria-valuetext", this.text.textContent);
    const present = store.active ? "Live" : "End";
    setText(this.live, moment ? `Back to ${present.toLowerCase()}` : present);
    this.live.disabled = moment === null;
    this.live.classList.toggle("primary", moment !== null);
    document.body.classList.toggle("past", moment !== null);
  }

  #words() {
    const { moments, moment } = timeline;
    if (moment)
      return `Past: ${clock(moment.time_s)} · ${fixed(moment.path_length_m, 1)} m (${timeline.place + 1} of ${moments.length})`;
    if (moments.length === 0) return "No moments yet";
    return store.active ? "Shows the present" : `Shows the end, ${clock(moments.at(-1).time_s)}`;
  }
}

customElements.define("time-line", TimeLine);
