// The page's texts by key: one catalogue for each language, flat JSON with `{name}` placeholders, one line a message.

import { computed, signal } from "@preact/signals";
import en from "./en.json";
import { readStored } from "./stored";
import { isolated } from "./text-isolation";

type Key = keyof typeof en;
type Catalogue = Readonly<Record<Key, string>>;

/** English defines the keys and is in the first bundle, the others are loaded when they are shown; they also
 * translate what arrives in English. Add a language as a file and a row. */
const CATALOGUES = {
  en: { name: "English", load: async () => en },
  zh: { name: "中文", load: async () => (await import("./zh.json")).default },
} satisfies Record<string, { name: string; load: () => Promise<Catalogue> }>;

export type Language = keyof typeof CATALOGUES;
export const LANGUAGES = Object.keys(CATALOGUES) as Language[];

/** Keys that all pages share; those of one section begin with its name and a dot. */
export type TextName = Exclude<Key, `${string}.${string}`>;
type WithoutSection<K, Section extends string> = K extends `${Section}.${infer Name}` ? Name : never;
export type NameIn<Section extends string> = (TextName | WithoutSection<Key, Section>) & string;
export type Values = Readonly<Record<string, string | number>>;

const STORAGE_KEY = "robomesh.language";
const FIRST_WAIT_MS = 2000;

const shownLanguage = signal<{ name: Language; catalogue: Catalogue }>({ name: "en", catalogue: en });
let wanted: Language = "en"; // while its catalogue is loaded
/** The page's language. */
export const language = computed(() => shownLanguage.value.name);

export const isLanguage = (name: string | null): name is Language => name !== null && Object.hasOwn(CATALOGUES, name);

function preferredLanguage(): Language {
  const stored = readStored(STORAGE_KEY);
  if (isLanguage(stored)) return stored;
  return LANGUAGES.find((each) => navigator.language.toLowerCase().startsWith(each)) ?? "en";
}

/** Show the page in a language, by default the preferred one. The language stays if its catalogue cannot be loaded,
 * for example because a newer console has another one. */
async function showLanguage(name = preferredLanguage()): Promise<void> {
  wanted = name;
  try {
    const catalogue = await CATALOGUES[name].load();
    if (wanted === name) shownLanguage.value = { name, catalogue };
  } catch (error) {
    console.error(error);
    wanted = language.peek();
  }
  document.documentElement.lang = t("language_tag");
}

/** Show the first language, after `FIRST_WAIT_MS` at the latest in English: the page has a stop, which must not wait
 * for texts. */
export const showFirstLanguage = (name?: Language): Promise<void> =>
  Promise.race([showLanguage(name), new Promise<void>((resolve) => setTimeout(resolve, FIRST_WAIT_MS))]);

/** Show the page in a language from now on; by default in the next one. */
export function switchLanguage(to?: Language): void {
  const next = to ?? LANGUAGES[(LANGUAGES.indexOf(wanted) + 1) % LANGUAGES.length] ?? "en";
  localStorage.setItem(STORAGE_KEY, next);
  void showLanguage(next);
}

export const languageName = (of: Language): string => CATALOGUES[of].name;

/** Return a message of the language's catalogue, or undefined. */
export function message(key: string): string | undefined {
  const catalogue: Readonly<Partial<Record<string, string>>> = shownLanguage.value.catalogue;
  return catalogue[key];
}

/** Return the names of a message's placeholders. */
export function placeholders(template: string): string[] {
  return [...template.matchAll(/\{(\w+)\}/g)].map(([, name = ""]) => name);
}

/** Replace the placeholders of a message that have a value, by default `isolated` as texts of other authors. */
export function filled(template: string, values: Values, shown: (value: string) => string = isolated): string {
  return template.replace(/\{(\w+)\}/g, (whole, name: string) => {
    const value = values[name];
    return value === undefined ? whole : shown(String(value));
  });
}

/** Return a text in the page's language. */
export function t(name: TextName, values: Values = {}): string {
  return filled(shownLanguage.value.catalogue[name], values);
}

/** Return a sentence made of sentences, which have their values `isolated` already. */
export function compose(name: TextName, sentences: Values): string {
  return filled(shownLanguage.value.catalogue[name], sentences, String);
}

/** Return the function that returns the texts of a section. */
function texts<Section extends string>(section: Section): (name: NameIn<Section>, values?: Values) => string {
  return (name, values = {}) => filled(message(keyIn(section, name)) ?? name, values);
}

/** Return a text of a section by a computed name, or undefined. */
export function textIn(section: string, name: string): string | undefined {
  return message(keyIn(section, name));
}

function keyIn(section: string, name: string): string {
  const own = `${section}.${name}`;
  return own in en ? own : name;
}

/** Return a view's name in words. */
export function viewText(name: string): string {
  return message(`view_${name}`) ?? name;
}

/** Return a text of a section in the page's language. */
export const accountText = texts("account");
export const cellText = texts("cell");
export const dayText = texts("day");
export const defineText = texts("define");
export const eventsText = texts("events");
export const fleetText = texts("fleet");
export const notesText = texts("notes");
export const plotsText = texts("plots");
export const programText = texts("program");
export const recordingsText = texts("recordings");
export const settingsText = texts("settings");
export const signalsText = texts("signals");
export const storedText = texts("stored_programs");
export const viewPageText = texts("view");
export const wallText = texts("wall");

/** A text that follows the page's language while it is shown. */
export type Words = () => string;
export const noWords: Words = () => "";
