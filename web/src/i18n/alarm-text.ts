// Alarms in Chinese by code: what happened and what to do; and the cause. In English the watch's own text is shown.

import type { Alarm } from "../gen/robomesh_pb";
import { reasonText } from "./reasons";
import { language } from "./texts";

const CHINESE: Record<string, readonly [title: string, advice: string]> = {
  "link.down": ["与控制器断开", "检查控制器电源、网线和站点文件中的地址。"],
  "link.silent": ["控制器无数据", "检查控制器电源、网线和站点文件中的地址。"],
  "link.deluge": ["数据不像来自控制器", "那里发送数据的可能不是控制器，或控制器已损坏。"],
  "controller.joint_count": ["关节数不符", "站点文件中的型号与控制器不一致。"],
  "controller.joint_values": ["关节值不可能正确", "线路损坏了数据，或站点文件中的型号不符：请看控制器自身的显示。"],
  "link.channel_lost": ["控制器的一个接口未连接", "请检查控制器的服务、站点文件和防火墙中的此端口。"],
  "link.flooding": ["控制器数据过载", "降低控制器的发送频率；目前仅发布最新数据。"],
  "controller.fault": ["控制器故障", "在控制器上排除故障，然后复位。"],
  "controller.stopped": ["机械臂已停止", "请到机器人旁查明原因：急停、安全功能或操作人员。"],
  "controller.local": ["控制器处于本地模式", "控制器旁有人在操作机器人，请询问他们。"],
  "stop.latched": ["已锁定停止", "查明停止原因；由控制者复位。"],
  "check.missing": ["运动检查不可用", "运动未按要求检查，请查看网关日志。"],
  "gateway.silent": ["网关无数据", "网关或其主机无响应：请重新启动。"],
  "joints.gone": ["没有关节位置", "控制器有数据但无位置，请检查控制器。"],
  "status.gone": ["没有控制器状态", "控制器不再发送状态，请检查控制器。"],
  "unit.malformed": ["收到无法读取的数据", "若持续出现，请检查线缆和协议。"],
  "controller.alarm": ["控制器报告警报", "请查看控制器自身的显示。"],
  "signals.too_many": ["控制器信号过多", "请减少控制器驱动上报的信号。"],
  "controller.refused": ["控制器拒绝了命令", "查看所请求的内容及拒绝原因。"],
  "stop.not_sent": ["停止未送达控制器", "此机器人只能监视：请在其面板上停止。"],
  "stop.disobeyed": ["已要求停止但仍在运动", "机器人仍在运动：请使用其急停。"],
  "motion.foreign": ["有人从别处移动机器人", "查明谁在移动机器人；查明前请远离。"],
  "lease.ended": ["控制权未归还", "控制权未被归还，请查看原控制者。"],
  "program.ended": ["程序提前结束", "查看结束的行和原因，然后重新运行。"],
  "check.warning": ["运动接近障碍", "运动靠近其他物体：请减速或绕行。"],
  "check.failed": ["检查未通过仍在运动", "检查未通过但运动已执行：请注视机器人并准备停止；原因见文本。"],
  "check.skipped": ["运动未经检查", "运动未经检查：请注视机器人并准备停止；文本说明缺少什么。"],
  "audit.failed": ["审计日志无法写入", "请清理审计日志所在磁盘；可写入之前拒绝一切运动。"],
  "audit.damaged": ["审计日志损坏", "请备份日志；robomesh audit verify 可指出断裂处。"],
  "gateway.failed": ["网关出错", "网关日志中有原因，请上报。"],
  "legacy.closed": ["旧客户端被断开", "有旧客户端程序不读取数据，请重新启动该程序。"],
  "legacy.turned_away": ["旧客户端被拒绝接入", "旧程序过多，或有未获许可者。"],
  "legacy.malformed": ["旧客户端数据无法读取", "有旧客户端程序发送无效数据，请检查。"],
  "kinematics.limit": ["关节接近限位", "请在到达限位之前将关节移回。"],
  "kinematics.clearance.warning": ["间距过小（警告）", "请远离，或减速。"],
  "kinematics.clearance.stop": ["间距过小", "距离过近：请移开。"],
  "kinematics.collision": ["发生接触", "两者已接触：运动之前请现场查看。"],
  "kinematics.not_counted": ["有机器人位置未知", "该机器人位置未知，间距计算未计入。"],
  "kinematics.floor": ["机器人低于地面", "请确认地面高度，并按文本所示写入站点文件。"],
  "recorder.gives_up": ["录制停止", "请清理录制文件夹，或移至更大的磁盘。"],
  "recorder.disk_slow": ["磁盘过慢", "磁盘跟不上，请查明还有谁在使用。"],
  "recorder.space": ["录制空间不足", "请清理录制文件夹，或移至更大的磁盘。"],
  "recorder.failed": ["录制出错", "请查看录制服务日志。"],
  "recorder.refused": ["录制被拒绝", "此次记录未被录制，原因见说明。"],
  "recorder.damaged": ["循环录制部分损坏", "最近几分钟中有一段无法读取，其余已保留。"],
  "recorder.not_saved": ["最近几分钟未保存", "请清理录制文件夹，或移至更大的磁盘。"],
  "recorder.not_recovered": ["录制文件未恢复", "请对该文件运行 robomesh recordings recover。"],
  "recorder.ended": ["录制意外结束", "请清理录制文件夹，或移至更大的磁盘。"],
  "recorder.flight_ended": ["循环录制意外结束", "请清理录制文件夹，或移至更大的磁盘。"],
  "renderer.slow": ["渲染跟不上", "请减少视图数量或尺寸。"],
  "router.without_rights": ["无权限者尝试接入", "证书已吊销或来自外部：请查明属于谁，必要时吊销。"],
  "router.imposter": ["路由器地址被他人占用", "查明该地址上是什么，然后重新启动路由器。"],
  "router.rules": ["权限规则无法读取", "用 robomesh keys 重新生成规则文件。"],
  "router.unlinked": ["与其他站点的路由器未连接", "检查站点文件 [router] connect，以及对方路由器是否运行。"],
  "token.refused": ["令牌未知", "该地址的屏幕或程序使用旧网址，或在尝试令牌：请查明。"],
  "account.refused": ["多次登录失败", "询问账户持有人是否本人操作；若不是，请停用账户或更换密码。"],
  "accounts.unreadable": ["账户文件无法读取", "请修复账户文件；在此之前账户保持不变。"],
  "service.gone": ["服务离线", "查看其日志，并重新启动。"],
  "service.problem": ["服务缺少一项功能", "其余功能正常；文字说明应做什么。"],
  "service.silent": ["服务无响应", "服务卡住，或其线路拥塞：查看日志并重新启动。"],
  "site.gone": ["站点失联", "到该站点的线路中断或站点已关闭：请联系其人员。"],
  "clock.off": ["时钟偏差", "请用 NTP 校时；录制中的时间会不一致。"],
  "mesh.versions": ["版本不一致", "请统一为同一版本。"],
  "mesh.twice": ["名称重复", "有两者使用同一名称：请结束或改名其一。"],
  "mesh.loss": ["数据丢失", "线路丢失数据：请查明何物占满线路。"],
  "certificate.expires": ["证书即将到期", "请续期：robomesh keys renew。"],
  "alarm.not_saved": ["报警无法保存", "请清理空间，或检查监视服务文件夹的写权限。"],
  "alarm.flood": ["报警过多", "从最紧急者中最早的开始处理，其余可能由它引起。"],
};

/** Return the Chinese text of an alarm with a known code; null: show the watch's text. */
export function alarmTitle(code: string): string | null {
  return language.value === "zh" ? (CHINESE[code]?.[0] ?? null) : null;
}

/** Return the Chinese text of an alarm with its cause; null: show the watch's text. */
export function alarmText({ code, cause }: Alarm): string | null {
  const [title, why] = [alarmTitle(code), reasonText(cause, "")];
  return title && why ? `${title}：${why}` : title;
}

export function alarmAdvice(code: string, told: string): string {
  return (language.value === "zh" && CHINESE[code]?.[1]) || told;
}
