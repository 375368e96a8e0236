// Texts of a view's page, in English and Chinese, with `{name}` placeholders.

import { inLanguage } from "./texts";

const TEXTS = {
  lost: ["No connection since {time}. This picture is not live.", "自 {time} 起连接中断，画面非实时。"],
  router_lost: ["The console has lost the mesh. This picture is not live.", "控制台与网络断开，画面非实时。"],
  waiting: ["Waiting for a picture", "等待图像"],
} as const;

/** Return a text of a view's page in the page's language. */
export function v(name: keyof typeof TEXTS, values: Record<string, string | number> = {}): string {
  return inLanguage(TEXTS[name], values);
}
