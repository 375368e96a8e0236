// A choice of one, where there is no space for buttons.

export function Select<Value extends string>(props: {
  label?: string;
  value: Value;
  values: readonly Value[];
  text: (value: Value) => string;
  choose: (value: Value) => void;
  class?: string;
  id?: string;
  "aria-invalid"?: boolean;
  "data-path"?: string;
}) {
  const { label, value, values, text, choose, ...attributes } = props;
  return (
    <select
      aria-label={label}
      {...attributes}
      value={value}
      onChange={(event) => choose(event.currentTarget.value as Value)}
    >
      {values.map((each) => (
        <option key={each} value={each} selected={each === value}>
          {text(each)}
        </option>
      ))}
    </select>
  );
}
