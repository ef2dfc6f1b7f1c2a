/** A glyph for each state, so that none is told by its colour alone. */
export const GLYPHS = {
  created: "○",
  queued: "⋯",
  starting: "◔",
  running: "▶",
  paused: "❚❚",
  stopping: "◼",
  interrupted: "↯",
  completed: "✓",
  failed: "✕",
  aborted: "⊘",
  none: "○",
};
