/**
 * Exchanges a token for a session, whose cookie no script can read, and goes on to the operator page. The form
 * cannot be sent before this script is there: a browser would send it by itself.
 */
import { Problem, getSession, openSession } from "./api.js";

const form = document.getElementById("login");
const token = document.getElementById("token");
const problem = document.getElementById("login-problem");
const button = form.querySelector("button");

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  problem.textContent = "";
  button.disabled = true;
  try {
    await openSession(token.value.trim());
    location.replace("./");
  } catch (error) {
    problem.textContent = explain(error);
    token.select();
  } finally {
    button.disabled = false;
  }
});

button.disabled = false;

function explain(error) {
  if (!(error instanceof Problem)) return String(error);
  if (error.status === 401) return "This is not a token of this service.";
  return error.message;
}

getSession().then(
  ({ role }) => {
    if (role) location.replace("./");
  },
  (error) => {
    problem.textContent = explain(error);
  },
);
