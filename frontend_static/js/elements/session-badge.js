/** Who is logged in, in which role, and the way out. Nothing where no login is needed. */
import { closeSession, toLogin } from "../api.js";
import { element } from "../format.js";
import { Part } from "../observable.js";
import { report, store } from "../store.js";

class SessionBadge extends Part {
  connectedCallback() {
    this.hidden = true;
    this.follow(store, ["session"], () => this.#draw());
  }

  #draw() {
    const session = store.session;
    this.hidden = !session?.login_required;
    if (this.hidden) return;
    const leave = element("button", { type: "button", id: "log-out" }, "Log out");
    leave.addEventListener("click", () => closeSession().then(toLogin, report));
    const who = session.name === session.role ? session.role : `${session.name}, ${session.role}`;
    this.replaceChildren(element("span", { id: "session-role", title: `Logged in as ${who}` }, who), leave);
  }
}

customElements.define("session-badge", SessionBadge);
