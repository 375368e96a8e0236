// A choice of one, where there is no space for buttons.

export function Select<Value extends string>(props: {
  label: string;
  value: Value;
  values: readonly Value[];
  text: (value: Value) => string;
  choose: (value: Value) => void;
}) {
  return (
    <select
      aria-label={props.label}
      value={props.value}
      onChange={(event) => props.choose(event.currentTarget.value as Value)}
    >
      {props.values.map((value) => (
        <option key={value} value={value}>
          {props.text(value)}
        </option>
      ))}
    </select>
  );
}
