// A short tone for a new unacknowledged alarm; off unless enabled in this browser.

import { effect, signal } from "@preact/signals";
import { anyWatch, nameOf, unacknowledged } from "../mesh/services/alarms";

const STORAGE_KEY = "robomesh.alarm-sound";
const TONES_HZ = [880, 660];
const TONE_S = 0.16;

export const sound = signal(localStorage.getItem(STORAGE_KEY) === "on");

export function setSound(on: boolean): void {
  sound.value = on;
  localStorage.setItem(STORAGE_KEY, on ? "on" : "off");
  if (on) play(); // demonstrates the tone; browsers need a click before they play it
}

/** Play the tone for each alarm that is new from now on. */
export function startSound(): () => void {
  let known: ReadonlySet<string> | null = null;
  return effect(() => {
    const names = new Set(unacknowledged.value.map(nameOf));
    if (known && sound.peek() && [...names].some((name) => !known?.has(name))) play();
    if (anyWatch.value) known = names; // the first list holds no new alarms
  });
}

let context: AudioContext | null = null;

function play(): void {
  const audio = (context ??= new AudioContext());
  void audio.resume();
  TONES_HZ.forEach((frequency, i) => {
    const tone = audio.createOscillator();
    const volume = audio.createGain();
    const begin = audio.currentTime + i * TONE_S;
    tone.frequency.value = frequency;
    volume.gain.setValueAtTime(0.2, begin);
    volume.gain.exponentialRampToValueAtTime(0.001, begin + TONE_S);
    tone.connect(volume).connect(audio.destination);
    tone.start(begin);
    tone.stop(begin + TONE_S);
  });
}
