// What the page says, by language. What the post says of reasons is in phrases.json.
const CATALOGUE = {
  en: {
    evacuate: "Evacuate", roll_call: "Roll call", message: "Message", units: "m / ft",
    theme: "Day / night", language: "한국어", sign_out: "Sign out", sign_in: "Sign in",
    name: "Name", password: "Password", fit: "Show all", alerts: "Alerts",
    no_alerts: "Nothing to attend to.", responders: "Responders", daps: "Access points",
    to_whom: "To whom", text: "Text", cancel: "Cancel", assign: "Assign", floors: "Floors",
    map: "Map", map_keys: "Map: arrow keys move it, plus and minus zoom", orders: "Orders",
    settings: "Settings", everybody: "Everybody, also who comes later", all_floors: "All floors",
    floor: "Floor", waiting: "waiting for the post", live: "live", lost_link: "no link to the post for",
    acknowledge: "Acknowledge", resolve: "Resolve", raised: "new", acknowledged: "acknowledged",
    assigned: "assigned to", resolved: "resolved", by: "by", send: "Send", ago: "ago",
    tracking: "tracked", dead_reckoning: "by own steps", lost: "LOST", recovering: "recovering",
    no_track: "no track yet", installed: "stands", not_installed: "carried", within: "within",
    heard: "heard", never: "never heard", not_acknowledged: "has not acknowledged",
    has_it: "has received", nobody: "Choose somebody.", text_needed: "Write something.",
    refused: "The post refuses:",
    doubtful: "doubtful", inside: "inside", lost_count: "lost", mayday: "MAYDAY", fall: "Fall",
    way_out: "Way out", rescue: "Rescue", close: "Close", walking: "walking", crawling: "crawling",
    on: "straight on", left: "left", right: "right", around: "turn around",
    upstairs: "upstairs", downstairs: "downstairs",
    motionless: "Motionless", lost_contact: "Lost contact", doubt: "Doubt", intruder: "Intruder",
    recording: "recording", time_line: "Time line", play: "Play", hold: "Pause", speed: "Speed",
    mark_before: "Event before", mark_next: "Next event", happened: "What happened",
    ordered: "ordered", received: "received", withdraw: "Withdrawn",
    compare: "Compare", compare_with: "The live tracks with", smoothed: "smoothed, with all that is known",
    fused_team: "fused anew as a team", fused_published: "fused anew as published", comparing: "fusing anew…",
    with_plan: "with the plan", with_settings: "with the other settings", off_now: "apart now",
    off_median: "median", off_p95: "95 %", off_most: "at most", export: "Export:", report: "Report",
    earth: "Origin", earth_what: "Where on the Earth a place of the incident is: its origin, or one that is clicked.",
    latitude: "Latitude (°)", longitude: "Longitude (°)", height: "Height above the ellipsoid (m)",
    bearing: "The incident's north, clockwise of true north (°)", earth_place: "The place: metres north, east",
    pick: "Click on the map", set: "Set",
    low_battery: "Low battery", low_air: "Low air", left_team: "Left the team", dap_dead: "Access point dead",
    dap_moved: "Access point moved", battery: "battery", charging: "charging", air: "air", air_for: "air for",
    seconds: "{n} s", minutes: "{n} min", hours: "{n} h", bits: "{n} bit", team: "Team",
    take_back: "Withdraw", acknowledged_by: "{n} of {of} have acknowledged", waited_for: "waiting for",
    north: "north", east: "east", more_daps: "Where a further access point would help",
  },
  ko: {
    evacuate: "대피", roll_call: "인원 점검", message: "메시지", units: "m / ft",
    theme: "주간 / 야간", language: "English", sign_out: "로그아웃", sign_in: "로그인",
    name: "이름", password: "비밀번호", fit: "전체 보기", alerts: "경보",
    no_alerts: "조치할 사항이 없습니다.", responders: "대원", daps: "액세스 포인트",
    to_whom: "대상", text: "내용", cancel: "취소", assign: "배정", floors: "층",
    map: "지도", map_keys: "지도: 화살표 키로 이동, + 와 - 로 확대·축소", orders: "지시",
    settings: "설정", everybody: "전원 (나중에 오는 대원 포함)", all_floors: "모든 층",
    floor: "층", waiting: "지휘소를 기다리는 중", live: "실시간", lost_link: "지휘소와 연결 끊김",
    acknowledge: "확인", resolve: "해결", raised: "신규", acknowledged: "확인됨",
    assigned: "배정됨:", resolved: "해결됨", by: "처리:", send: "보내기", ago: "전",
    tracking: "추적 중", dead_reckoning: "걸음 추정", lost: "위치 불명", recovering: "복구 중",
    no_track: "위치 없음", installed: "설치됨", not_installed: "휴대 중", within: "오차",
    heard: "수신", never: "수신 없음", not_acknowledged: "미확인",
    has_it: "수신함", nobody: "대상을 선택하십시오.", text_needed: "내용을 입력하십시오.",
    refused: "지휘소 거부:",
    doubtful: "확인 필요", inside: "내부", lost_count: "위치 불명", mayday: "메이데이", fall: "추락·넘어짐",
    way_out: "나가는 길", rescue: "구조", close: "닫기", walking: "걸어서", crawling: "기어서",
    on: "직진", left: "왼쪽", right: "오른쪽", around: "뒤로 돌아",
    upstairs: "위층으로", downstairs: "아래층으로",
    motionless: "움직임 없음", lost_contact: "연락 두절", doubt: "의심", intruder: "침입자",
    recording: "기록", time_line: "시간선", play: "재생", hold: "일시 정지", speed: "속도",
    mark_before: "이전 사건", mark_next: "다음 사건", happened: "발생한 일",
    ordered: "지시함", received: "수신함", withdraw: "철회",
    compare: "비교", compare_with: "실시간 경로와", smoothed: "전체 자료로 다듬은 경로",
    fused_team: "팀 융합 재계산", fused_published: "공개 방식 재계산", comparing: "재계산 중…",
    with_plan: "도면 사용", with_settings: "다른 설정 사용", off_now: "현재 차이",
    off_median: "중앙값", off_p95: "95 %", off_most: "최대", export: "내보내기:", report: "보고서",
    earth: "기준점", earth_what: "현장의 한 지점이 지구상 어디인지: 기준점 또는 지도에서 누른 지점.",
    latitude: "위도 (°)", longitude: "경도 (°)", height: "타원체고 (m)",
    bearing: "현장 북쪽이 진북에서 시계 방향으로 돌아간 각 (°)", earth_place: "지점: 북쪽, 동쪽 (m)",
    pick: "지도에서 선택", set: "설정",
    low_battery: "배터리 부족", low_air: "공기 부족", left_team: "팀 이탈", dap_dead: "액세스 포인트 꺼짐",
    dap_moved: "액세스 포인트 이동", battery: "배터리", charging: "충전 중", air: "공기", air_for: "공기 잔여",
    seconds: "{n}초", minutes: "{n}분", hours: "{n}시간", bits: "{n}비트", team: "팀",
    take_back: "지시 철회", acknowledged_by: "{of}명 중 {n}명 확인", waited_for: "미확인:",
    north: "북", east: "동", more_daps: "액세스 포인트를 더 놓으면 좋은 곳",
  },
};

const FEET_PER_M = 3.28084;
let language = localStorage.getItem("language") ?? "en";
let feet = localStorage.getItem("feet") === "yes";

export const languageNow = () => language;
export const inFeet = () => feet;
export const word = (name) => CATALOGUE[language][name] ?? name;

export function changeLanguage() {
  language = language === "en" ? "ko" : "en";
  localStorage.setItem("language", language);
}

export function changeUnits() {
  feet = !feet;
  localStorage.setItem("feet", feet ? "yes" : "no");
}

/** A length in metres, in the units that were chosen. */
export function length(metres) {
  const value = feet ? metres * FEET_PER_M : metres;
  return `${value < 9.95 ? value.toFixed(1) : Math.round(value)} ${feet ? "ft" : "m"}`;
}

/** A word with numbers in it. */
export function counted(name, numbers) {
  return word(name).replace(/\{(\w+)\}/g, (_, key) => numbers[key]);
}

/** How long, in words as short as can be. */
export function duration(seconds) {
  const whole = (name, each) => counted(name, { n: Math.floor(seconds / each) });
  if (seconds < 60) return whole("seconds", 1);
  if (seconds < 3600) return whole("minutes", 60);
  return `${whole("hours", 3600)} ${counted("minutes", { n: Math.floor((seconds % 3600) / 60) })}`;
}

/** Write all words that stand in the page. */
export function writeWords() {
  document.documentElement.lang = language;
  for (const one of document.querySelectorAll("[data-word]")) one.textContent = word(one.dataset.word);
  for (const one of document.querySelectorAll("[data-label]")) {
    one.setAttribute("aria-label", word(one.dataset.label));
  }
}
