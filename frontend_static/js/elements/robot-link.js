/** The live robot of a mission, and how the link to it does; hidden where the robot is simulated. */
import { getRobot } from "../api.js";
import { count, element, fixed, setText } from "../format.js";
import { Part } from "../observable.js";
import { store } from "../store.js";

const LOOK_MS = 1000;
const ACTIVE = new Set(["starting", "running", "paused", "stopping"]);

class RobotLink extends Part {
  #looking = false;

  connectedCallback() {
    this.heading = element("h3", {}, "Robot");
    this.state = element("p", { id: "robot-state", role: "status" });
    this.place = element("p", { id: "robot-place" });
    this.frames = element("p", { id: "robot-frames" });
    this.append(this.heading, this.state, this.place, this.frames);
    this.hidden = true;
    this.every(LOOK_MS, () => this.#look());
    this.follow(store, ["mission"], () => this.#look());
  }

  async #look() {
    const mission = store.mission;
    const wanted = mission?.scene === "live" && ACTIVE.has(mission.state);
    this.hidden = !wanted;
    if (!wanted || this.#looking) return;
    this.#looking = true;
    try {
      const robot = await getRobot(mission.id);
      if (store.mission?.id === mission.id) this.#draw(robot);
    } catch (error) {
      this.#draw(null, error.message);
    } finally {
      this.#looking = false;
    }
  }

  #draw(robot, complaint = "") {
    this.classList.toggle("away", !robot?.connected);
    setText(this.state, robot ? stateOf(robot) : complaint);
    setText(this.place, robot?.report ? placeOf(robot.report) : "");
    setText(this.frames, robot ? framesOf(robot) : "");
  }
}

function stateOf(robot) {
  const name = robot.robot ?? "No robot yet";
  if (!robot.connected) return `✕ ${name}: not connected`;
  const ago = robot.heard_at === null ? 0 : Math.max(0, Date.now() / 1000 - robot.heard_at);
  return `● ${name}: connected, heard ${fixed(ago, 1)} s ago`;
}

function placeOf(report) {
  const where = `(${fixed(report.x_m, 2)}, ${fixed(report.y_m, 2)}) m, ${fixed(report.yaw_deg, 0)}°`;
  return `${report.standing ? "Stands" : "Drives"} at ${where}; obeys command ${report.command}`;
}

function framesOf(robot) {
  const lost = robot.frames_dropped ? `, ${count(robot.frames_dropped)} overtaken on the way` : "";
  const missed = robot.missed ? `; ${count(robot.missed)} reports or clouds not taken` : "";
  const refused = robot.refused ? `; ${count(robot.refused)} messages refused` : "";
  return `${count(robot.frames)} frames${lost}${missed}${refused}`;
}

customElements.define("robot-link", RobotLink);
