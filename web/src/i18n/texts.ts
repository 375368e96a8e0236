// The page's texts by key: one catalogue for each language, flat JSON with `{name}` placeholders, one line a message.

import { signal } from "@preact/signals";
import en from "./en.json";
import { isolated } from "./foreign-text";
import { readStored } from "./stored";
import zh from "./zh.json";

type Key = keyof typeof en;

/** English defines the keys; the others also translate what arrives in English. Add a language as a file and a name. */
const CATALOGUES = { en, zh } satisfies Record<string, Readonly<Record<Key, string>>>;

export type Language = keyof typeof CATALOGUES;
export const LANGUAGES = Object.keys(CATALOGUES) as Language[];

/** Keys that all pages share; those of one section begin with its name and a dot. */
export type TextName = Exclude<Key, `${string}.${string}`>;
type WithoutSection<K, Section extends string> = K extends `${Section}.${infer Name}` ? Name : never;
export type NameIn<Section extends string> = (TextName | WithoutSection<Key, Section>) & string;
export type Values = Readonly<Record<string, string | number>>;

const STORAGE_KEY = "robomesh.language";

export const isLanguage = (name: string | null): name is Language => name !== null && Object.hasOwn(CATALOGUES, name);

function initialLanguage(): Language {
  const stored = readStored(STORAGE_KEY);
  if (isLanguage(stored)) return stored;
  return LANGUAGES.find((each) => navigator.language.toLowerCase().startsWith(each)) ?? "en";
}

export const language = signal<Language>(initialLanguage());

/** Show the page in a language; by default in the next one. */
export function switchLanguage(to?: Language): void {
  language.value = to ?? LANGUAGES[(LANGUAGES.indexOf(language.value) + 1) % LANGUAGES.length] ?? "en";
  localStorage.setItem(STORAGE_KEY, language.value);
  declareLanguage();
}

/** Tell the browser the page's language. */
export function declareLanguage(): void {
  document.documentElement.lang = t("language_tag");
}

export const languageName = (of: Language): string => CATALOGUES[of].language_name;

/** Return a message of the language's catalogue, or undefined. */
export function message(key: string): string | undefined {
  const catalogue: Readonly<Partial<Record<string, string>>> = CATALOGUES[language.value];
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
  return filled(CATALOGUES[language.value][name], values);
}

/** Return a sentence made of sentences, which have their values `isolated` already. */
export function compose(name: TextName, sentences: Values): string {
  return filled(CATALOGUES[language.value][name], sentences, String);
}

/** Return the function that returns the texts of a section. */
export function texts<Section extends string>(section: Section): (name: NameIn<Section>, values?: Values) => string {
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
