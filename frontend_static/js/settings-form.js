/** From a JSON Schema of settings to fields of a form: each with its path, kind, range, unit and meaning. */

/**
 * Sections `{name, title, description, fields}` in the schema's order; a field is
 * `{path, title, kind, description, unit, minimum, maximum, exclusive, choices, nullable, value}`, where `kind` is
 * number, integer, boolean, choice or text. What stands at the top level alone is in a section without a name.
 */
export function sectionsOf(schema, values) {
  const sections = new Map();
  walk(schema, schema, values, [], (path, described, value) => {
    const name = path.slice(0, -1).join(".");
    if (!sections.has(name)) {
      const section = name ? sectionAt(schema, path.slice(0, -1)) : {};
      sections.set(name, { name, description: sentence(section.description), fields: [] });
    }
    sections.get(name).fields.push(fieldOf(path, described, value));
  });
  return [...sections.values()];
}

/** The text of an override that sets `value`. */
export const overrideText = (value) => (value === null ? "null" : String(value));

function walk(root, node, values, path, take) {
  for (const [name, raw] of Object.entries(node.properties ?? {})) {
    const described = resolved(root, raw);
    const value = values?.[name];
    if (described.properties) walk(root, described, value, [...path, name], take);
    else take([...path, name], described, value);
  }
}

function sectionAt(root, path) {
  return path.reduce((node, name) => resolved(root, node.properties[name]), root);
}

/** `node` with what it refers to; its own words win. */
function resolved(root, node) {
  let found = node;
  const alternatives = found.anyOf?.filter(({ type }) => type !== "null");
  if (alternatives?.length === 1)
    found = { ...resolved(root, alternatives[0]), ...found, nullable: true, anyOf: undefined };
  if (found.allOf?.length === 1) found = { ...resolved(root, found.allOf[0]), ...found };
  if (found.$ref) {
    const target = root.$defs[found.$ref.split("/").at(-1)];
    const own = { ...found };
    delete own.$ref;
    found = { ...resolved(root, target), ...own };
  }
  return found;
}

function fieldOf(path, described, value) {
  const text = sentence(described.description);
  return {
    path: path.join("."),
    title: titleOf(path.at(-1)),
    kind: kindOf(described),
    description: text,
    unit: unitOf(path.at(-1), text),
    minimum: described.minimum ?? described.exclusiveMinimum,
    maximum: described.maximum ?? described.exclusiveMaximum,
    exclusive: described.exclusiveMinimum !== undefined,
    choices: described.enum ?? (described.const === undefined ? null : [described.const]),
    nullable: Boolean(described.nullable),
    value,
  };
}

function kindOf({ type, enum: choices }) {
  if (choices) return "choice";
  return ["number", "integer", "boolean"].includes(type) ? type : "text";
}

const sentence = (text) => (text ?? "").replace(/\s+/g, " ").trim();

const UNITS = [
  [/_degps$/, "°/s"],
  [/_mps$/, "m/s"],
  [/_per_m2$/, "1/m²"],
  [/_per_s$/, "1/s"],
  [/_m3$/, "m³"],
  [/_m2$/, "m²"],
  [/_px$/, "px"],
  [/_deg$/, "°"],
  [/_db$/, "dB"],
  [/_m$/, "m"],
  [/_s$/, "s"],
];

/** In words, without the unit that ends it. */
function titleOf(name) {
  const named = UNITS.find(([ending]) => ending.test(name));
  return (named ? name.replace(named[0], "") : name).replaceAll("_", " ");
}

/** From the end of the name, where it has one, or else from brackets in its description. */
function unitOf(name, description) {
  const named = UNITS.find(([ending]) => ending.test(name));
  if (named) return named[1];
  const [, bracketed] = description.match(/\[([^\]]{1,10})\]/) ?? [];
  return { pixels: "px", degrees: "°" }[bracketed] ?? bracketed ?? "";
}
