// Visibility of tiles: only tiles on the screen or close to it are subscribed and drawn.

import type { RefObject } from "preact";
import { useEffect, useState } from "preact/hooks";

// A tile that is only scrolled past causes no subscription.
const COMES_AFTER_MS = 120;
const GOES_AFTER_MS = 400;

const listeners = new WeakMap<Element, (visible: boolean) => void>();
const observer = new IntersectionObserver(
  (entries) => {
    for (const entry of entries) listeners.get(entry.target)?.(entry.isIntersecting);
  },
  { rootMargin: "160px 0px" },
);

export function useVisible(place: RefObject<Element | null>): boolean {
  const [visible, setVisible] = useState(false);
  useEffect(() => {
    const element = place.current;
    if (!element) return;
    let timer: ReturnType<typeof setTimeout> | undefined;
    listeners.set(element, (shown) => {
      clearTimeout(timer);
      timer = setTimeout(() => setVisible(shown), shown ? COMES_AFTER_MS : GOES_AFTER_MS);
    });
    observer.observe(element);
    return () => {
      clearTimeout(timer);
      observer.unobserve(element);
    };
  }, []);
  return visible;
}
