// A drawing of an arm in the place of a missing picture.

/** A drawing in the place of a missing picture. */
export function Silhouette({ label }: { label: string }) {
  return (
    <svg viewBox="0 0 160 90" class="silhouette" role="img" aria-label={label}>
      <path d="M50 80h38M68 80V56l26-24 24 16" />
      <circle cx="68" cy="54" r="6" />
      <circle cx="94" cy="32" r="5" />
      <circle cx="118" cy="48" r="4" />
    </svg>
  );
}
