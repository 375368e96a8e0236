// A list of thousands of lines of equal height that renders only the visible ones.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";

const OVER = 8; // extra lines above and below

export function VirtualList<Item>(props: {
  label: string;
  items: readonly Item[];
  /** px. */
  lineHeight: number;
  line: (item: Item, index: number) => ComponentChildren;
}) {
  const { items, lineHeight } = props;
  const place = useRef<HTMLDivElement>(null);
  const [scrolled, setScrolled] = useState({ top: 0, height: 400 });
  const updateWindow = () => {
    const element = place.current;
    if (element) setScrolled({ top: element.scrollTop, height: element.clientHeight });
  };
  useEffect(() => {
    const observer = new ResizeObserver(updateWindow);
    if (place.current) observer.observe(place.current);
    return () => observer.disconnect();
  }, []);
  const first = Math.max(0, Math.min(items.length, Math.floor(scrolled.top / lineHeight)) - OVER);
  const last = Math.min(items.length, Math.ceil((scrolled.top + scrolled.height) / lineHeight) + OVER);
  return (
    <div
      ref={place}
      class="virtual-list scroll ruled"
      tabIndex={0}
      role="group"
      aria-label={props.label}
      onScroll={updateWindow}
    >
      <ol style={{ height: `${items.length * lineHeight}px` }}>
        {items.slice(first, last).map((item, i) => (
          <li
            key={first + i}
            style={{ transform: `translateY(${(first + i) * lineHeight}px)`, height: `${lineHeight}px` }}
            aria-setsize={items.length}
            aria-posinset={first + i + 1}
          >
            {props.line(item, first + i)}
          </li>
        ))}
      </ol>
    </div>
  );
}
