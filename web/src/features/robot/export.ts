// Export of a live picture: a still as PNG, or a part of the video as MP4.

import { useEffect, useRef, useState } from "preact/hooks";
import { t } from "../../i18n/texts";
import { reasonOf } from "../../mesh/console/connection";
import { readRefusal } from "../../mesh/console/refusal";
import { saveFile } from "../../ui/page/save-file";

// A browser keeps the recording in memory.
const MOST_BYTES = 512 * 1024 * 1024;

/** Return a file name with the current time: pt600-front-20261121-140211.png */
export function dated(name: string): string {
  const at = new Date();
  const two = (value: number) => String(value).padStart(2, "0");
  const day = `${at.getFullYear()}${two(at.getMonth() + 1)}${two(at.getDate())}`;
  const time = `${two(at.getHours())}${two(at.getMinutes())}${two(at.getSeconds())}`;
  return name.replace(/(\.\w+)$/, `-${day}-${time}$1`);
}

/** Return the displayed picture as PNG.
 *
 * @throws Error without a picture. */
export async function saveStill(shown: HTMLCanvasElement | HTMLImageElement | null): Promise<Blob> {
  let canvas = shown instanceof HTMLCanvasElement ? shown : null;
  if (shown instanceof HTMLImageElement) {
    canvas = document.createElement("canvas");
    canvas.width = shown.naturalWidth;
    canvas.height = shown.naturalHeight;
    canvas.getContext("2d")?.drawImage(shown, 0, 0);
  }
  const blob = canvas && (await new Promise<Blob | null>((done) => canvas.toBlob(done, "image/png")));
  if (!blob) throw new Error(t("no_picture"));
  return blob;
}

export interface VideoRecording {
  on: boolean;
  seconds: number;
  problem: string;
  toggle: () => void;
}

/** Record a view's live MP4 between two presses, then save it; it ends when the memory limit is reached. */
export function useRecording(address: string, name: string): VideoRecording {
  const [since, setSince] = useState<number | null>(null); // 0: no data yet
  const [seconds, setSeconds] = useState(0);
  const [problem, setProblem] = useState("");
  const end = useRef<AbortController | null>(null);
  useEffect(() => () => end.current?.abort(), [address]);
  useEffect(() => {
    if (!since) return;
    const timer = setInterval(() => setSeconds((performance.now() - since) / 1000), 500);
    return () => clearInterval(timer);
  }, [since]);
  const record = async () => {
    const stop = new AbortController();
    end.current = stop;
    setProblem("");
    setSeconds(0);
    setSince(0);
    const pieces: Uint8Array<ArrayBuffer>[] = [];
    let bytes = 0;
    try {
      const answer = await fetch(address, { signal: stop.signal });
      if (!answer.ok || !answer.body) throw await readRefusal(answer);
      const reader = answer.body.getReader();
      while (bytes < MOST_BYTES) {
        const { done, value } = await reader.read();
        if (done) break;
        if (pieces.length === 0) setSince(performance.now());
        pieces.push(value);
        bytes += value.byteLength;
      }
      stop.abort();
    } catch (error) {
      if (!stop.signal.aborted) setProblem(t("record_failed", { text: reasonOf(error) }));
    }
    end.current = null;
    setSince(null);
    if (bytes) saveFile(new Blob(pieces, { type: "video/mp4" }), dated(name));
  };
  const toggle = () => (end.current ? end.current.abort() : void record());
  return { on: since !== null, seconds, problem, toggle };
}
