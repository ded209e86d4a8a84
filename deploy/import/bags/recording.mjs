// The measurements of one recording: a table of the wheels, tables of everything slower or faster to be
// joined to it, and the mapping by which `joulecast import` reads them.

const yawOf = (q) => Math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z));
// ROS turns about y to the left of the robot, so nose down is positive there; nose up is positive here.
const noseUpOf = (q) => -Math.asin(Math.max(-1, Math.min(1, 2 * (q.w * q.y - q.z * q.x))));
const poseOf = ({ position, orientation }) => [position.x, position.y, yawOf(orientation)];
const twistOf = (twist) => [twist.linear.x, twist.angular.z];
// The last part of a frame's name, without the prefix of a robot.
const frameOf = (name) => name.replace(/^.*\//, '');
function linkOf({ header, child_frame_id: child, transform: { translation, rotation } }) {
  const at = [translation.x, translation.y, yawOf(rotation)];
  return { parent: frameOf(header.frame_id), child: frameOf(child), at, name: child };
}

// One list for the equal lists of names that every message repeats.
const lists = new Map();
function shared(names) {
  const key = names.join('\n');
  if (!lists.has(key)) lists.set(key, names);
  return lists.get(key);
}

// Of each message type: the fields to keep, and the roles that its topic may have.
const kinds = {
  'sensor_msgs/JointState': [
    ({ name, position, velocity }) => ({ name: shared(name), position, velocity }),
    'wheels',
  ],
  'nav_msgs/Odometry': [(m) => [...poseOf(m.pose.pose), ...twistOf(m.twist.twist)], 'wheels', 'pose'],
  'sensor_msgs/BatteryState': [(m) => [m.voltage, m.current], 'battery'],
  'geometry_msgs/Twist': [twistOf, 'command'],
  'geometry_msgs/TwistStamped': [(m) => twistOf(m.twist), 'command'],
  // An IMU that does not estimate a quantity sets the first element of its covariance to -1.
  'sensor_msgs/Imu': [
    (m) => [
      m.angular_velocity_covariance[0] < 0 ? NaN : m.angular_velocity.z,
      m.orientation_covariance[0] < 0 ? NaN : noseUpOf(m.orientation),
    ],
    'imu',
  ],
  'sensor_msgs/Temperature': [(m) => [m.temperature], 'temperature'],
  'geometry_msgs/PoseStamped': [(m) => poseOf(m.pose), 'pose'],
  'geometry_msgs/PoseWithCovarianceStamped': [(m) => poseOf(m.pose.pose), 'pose'],
  'tf2_msgs/TFMessage': [linkOf, 'pose'],
  'tf/tfMessage': [linkOf, 'pose'],
};
const isTf = (topic) => kinds[topic.kind][0] === linkOf;

// The preferred topic of a role; of equals the one with most messages. Of batteries the one whose current
// changes most often at a voltage of the robot's pack. Poses in the map's frame come before those of
// odometry, which drift; a goal is no pose of the robot.
const preferences = {
  wheels: (t) => (t.kind === 'sensor_msgs/JointState' ? 0 : 1) + (/wheel|(^|\/)odom$/.test(t.name) ? 0 : 0.5),
  battery: ({ rows }, robot) =>
    -rows.filter(({ data: [volts, amps] }, k) => {
      const share = volts / (robot.battery?.nominal_voltage_v ?? volts);
      return share > 0.6 && share < 1.5 && Math.abs(amps - rows[k - 1]?.data[1]) > 0;
    }).length,
  imu: (t) => (/\/data$/.test(t.name) ? 0 : 1),
  command: (t) => (/(^|\/)cmd_vel$/.test(t.name) ? 0 : /cmd|command/.test(t.name) ? 1 : 2),
  pose: (t) => {
    if (/goal|initialpose|target/.test(t.name)) return Infinity;
    return isTf(t) ? 0 : t.kind.startsWith('geometry_msgs') ? 1 : 2;
  },
};
const settings = ['robot_id', 'payload_kg', 'topics', 'joints', 'hold_s', 'battery_current'];
const holdPeriods = 3; // a value holds over two lost messages
const clockToleranceUs = 1e6;
const year2000Us = 946_684_800e6;

const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];
const list = (names) => [...names].sort().join(', ') || 'none';

// A mistake in the file of --mapping.
const wrong = (message) => Object.assign(new Error(message), { option: '--mapping' });

export class Recording {
  topics = new Map();
  warnings = [];

  // `choices` is the file of --mapping, `robot` that of --robot, both parsed or {}.
  constructor(choices, robot) {
    const unknown = Object.keys(choices).filter((name) => !settings.includes(name));
    if (unknown.length)
      throw wrong(`unknown member '${unknown[0]}'; a mapping of bags has ${list(settings)}`);
    const roles = Object.keys(choices.topics ?? {}).filter((role) => !(role in preferences));
    if (roles.length) throw wrong(`topics: '${roles[0]}' is none of ${list(Object.keys(preferences))}`);
    if (!['positive_charging', 'positive_discharging', undefined].includes(choices.battery_current))
      throw wrong('battery_current is positive_charging (as in ROS) or positive_discharging');
    this.choices = choices;
    this.robot = robot;
  }

  wants(type) {
    return type.replace('/msg/', '/') in kinds;
  }
  see(name, type, count) {
    const kind = type.replace('/msg/', '/');
    const topic = this.topics.get(name) ?? { name, type, kind, count: 0, rows: [] };
    this.topics.set(name, topic);
    topic.count += Number(count);
    return topic;
  }
  warn(text) {
    this.warnings.push(text);
  }
  // `decode` returns the message; one that it cannot read is left out.
  put(name, receiptUs, decode) {
    const topic = this.topics.get(name);
    let message;
    try {
      message = decode();
    } catch (error) {
      const text = `${name}: messages that cannot be decoded are left out (${error.message})`;
      if (!this.warnings.includes(text)) this.warn(text);
      return;
    }
    for (const part of message.transforms ?? [message]) {
      const { sec, nsec, nanosec } = part.header?.stamp ?? { sec: 0, nsec: 0 };
      const stampUs = sec * 1e6 + (nsec ?? nanosec) / 1e3;
      topic.rows.push({ receiptUs, stampUs, data: kinds[topic.kind][0](part) });
    }
  }

  // When messages came, the first and the last.
  span() {
    const times = [...this.topics.values()].flatMap((t) =>
      t.rows.length ? [t.rows[0].receiptUs, t.rows.at(-1).receiptUs] : [],
    );
    return [Math.min(...times), Math.max(...times)];
  }
  // Adds another file if it is of the same recording: at the same time, or within a second of it.
  absorb(other) {
    const [[begin, end], [from, to]] = [this.span(), other.span()];
    if (from > end + clockToleranceUs || begin > to + clockToleranceUs) return false;
    for (const { name, type, count, rows } of other.topics.values()) {
      const topic = this.see(name, type, count);
      topic.rows = from < begin ? [...rows, ...topic.rows] : [...topic.rows, ...rows];
    }
    this.warnings.push(...other.warnings);
    return true;
  }

  // A clock that starts again begins another recording: the parts between, by times of receipt.
  parts() {
    const rows = [...this.wheels().topic.rows].sort((a, b) => a.receiptUs - b.receiptUs);
    const begins = rows
      .filter((row, k) => row.stampUs > 0 && rows[k - 1]?.stampUs - row.stampUs > clockToleranceUs)
      .map((row) => row.receiptUs);
    // Publishers with two clocks take turns.
    if (!begins.length || begins.length * 4 > rows.length) return [this];
    return [-Infinity, ...begins].map((begin, k) => {
      const part = new Recording(this.choices, this.robot);
      for (const { name, type, rows } of this.topics.values()) {
        const kept = rows.filter(
          (row) => /static/.test(name) || (row.receiptUs >= begin && row.receiptUs < (begins[k] ?? Infinity)),
        );
        part.see(name, type, kept.length).rows = kept;
      }
      part.warnings.push(...(k > 0 ? [] : this.warnings));
      if (k > 0) part.warn('the clock of the wheels starts again: a new mission begins');
      return part;
    });
  }

  // Topics that may have a role, the best first.
  candidates(role) {
    const chosen = this.choices.topics?.[role];
    if (chosen === null) return [];
    const able = [...this.topics.values()].filter((t) => kinds[t.kind]?.includes(role) && t.rows.length > 0);
    if (chosen === undefined) {
      const rank = (t) => preferences[role](t, this.robot);
      return able
        .filter((t) => rank(t) < Infinity && !this.isForeign(t.name))
        .sort((a, b) => rank(a) - rank(b) || b.count - a.count || (a.name < b.name ? -1 : 1));
    }
    const found = able.filter((t) => t.name === chosen);
    if (!found.length)
      throw wrong(
        `topics: '${chosen}' has no messages for ${role}; there are ${list(able.map((t) => t.name))}`,
      );
    return found;
  }

  // Whether a topic or frame is in the namespace of another robot.
  isForeign(name) {
    return this.foreign?.some((space) => `/${name}`.replace('//', '/').startsWith(space));
  }

  // Namespaces beside that of the wheels with the same topics: one of joints of both sides, or of odometry and
  // another, such as /amr_2/ with odom and battery_state if the wheels are /amr_1/odom.
  foreignTo(wheels) {
    const own = wheels.name.split('/');
    const others = (at, space) =>
      [...this.topics.keys()].filter((name) => {
        const parts = name.split('/');
        const ours = [...parts.slice(0, at), own[at], ...parts.slice(at + 1)].join('/');
        return parts[at] === space && ours !== wheels.name && this.topics.has(ours);
      });
    return [...this.topics.values()].flatMap(({ name, kind, rows }) => {
      const parts = name.split('/');
      const [at, ...more] = [...own.keys()].filter((k) => own[k] !== parts[k]);
      if (kind !== wheels.kind || parts.length !== own.length || more.length || !(at < own.length - 1))
        return [];
      const names = new Set();
      for (const { data } of rows) for (const joint of data.name ?? []) names.add(joint);
      const { right, left } = this.joints(names);
      const alike = names.size
        ? [right, left].every((side) => side.some((joint) => names.has(joint)))
        : others(at, parts[at]).length;
      return alike ? [`${parts.slice(0, at + 1).join('/')}/`] : [];
    });
  }

  wheels() {
    const found = this.findWheels();
    this.foreign = this.foreignTo(found.topic);
    if (this.foreign.length)
      this.warn(
        `topics below ${list(this.foreign)} belong to other robots and are left out; --mapping with {"topics": {"wheels": "..."}} imports one of them`,
      );
    return found;
  }

  // Rows of [right, left], rad/s, or of positions where no velocity was published.
  findWheels() {
    const namesSeen = new Set();
    for (const topic of this.candidates('wheels')) {
      if (topic.kind === 'nav_msgs/Odometry') {
        if (namesSeen.size) break;
        const { wheel_radius_m: radius, half_track_m: half } = this.robot.kinematics ?? {};
        if (!radius)
          throw new Error(
            `${topic.name}: wheel speeds from odometry need the robot's kinematics: give --robot`,
          );
        const of = ([, , , v, w]) => [(v + half * w) / radius, (v - half * w) / radius];
        return {
          topic,
          rows: topic.rows.map((row) => ({ ...row, data: of(row.data) })),
          how: "its twist and the robot's kinematics",
        };
      }
      topic.rows.forEach(({ data }) => data.name.forEach((name) => namesSeen.add(name)));
      const joints = this.joints(namesSeen);
      if (joints.right.length && joints.left.length) return this.ofJoints(topic, joints);
    }
    if (namesSeen.size)
      throw new Error(
        `no joints of a right and a left wheel are among ${list(namesSeen)}; --mapping names them, {"joints": {"right": "...", "left": "..."}}, or odometry, {"topics": {"wheels": "/odom"}}`,
      );
    throw new Error(
      `no JointState and no Odometry with the wheels' speeds; topics: ${list([...this.topics.values()].map((t) => `${t.name} (${t.type})`))}`,
    );
  }

  joints(names) {
    const chosen = this.choices.joints;
    if (chosen) return { right: [chosen.right].flat(), left: [chosen.left].flat() };
    const sides = (driven) => {
      const able = [...names].filter(
        (name) => driven.test(name) && !/cast[eo]r|steer|swivel|pivot/i.test(name),
      );
      // wheel_right, r_wheel, wheelR
      const side = (word, end) => able.filter((name) => word.test(name) || end.test(name));
      return {
        right: side(/right|(?<![a-z])[fmbr]?r(?=wheel|[^a-z]|$)/i, /[a-z0-9]R$/),
        left: side(/left|(?<![a-z])[fmbr]?l(?=wheel|[^a-z]|$)/i, /[a-z0-9]L$/),
      };
    };
    const wheels = sides(/wheel|whl/i);
    return wheels.right.length && wheels.left.length ? wheels : sides(/drive|track|tread/i);
  }

  ofJoints(topic, joints) {
    // Of velocities the mean of a side's wheels; of positions, which may leap by a turn, the first wheel's.
    const read = (data, field, names) => {
      const values = names.map((name) => data[field]?.[data.name.indexOf(name)]).filter(Number.isFinite);
      if (field === 'position' || !values.length) return values[0];
      return values.reduce((sum, value) => sum + value, 0) / values.length;
    };
    const rowsOf = (field) => {
      const half = []; // where each wheel has messages of its own
      const ordered = [...topic.rows].sort((a, b) => a.receiptUs - b.receiptUs);
      return ordered.flatMap((row) => {
        for (const [k, names] of [joints.right, joints.left].entries())
          half[k] = read(row.data, field, names) ?? half[k];
        return half.every(Number.isFinite) ? [{ ...row, data: half.splice(0) }] : [];
      });
    };
    const velocities = rowsOf('velocity');
    const positions = rowsOf('position');
    const changes = (rows) =>
      rows.some(({ data }) => data[0] !== rows[0].data[0] || data[1] !== rows[0].data[1]);
    // Publishers that do not measure velocity omit it or send zeros.
    const zero = velocities.every(({ data }) => data[0] === 0 && data[1] === 0);
    const derived = velocities.length < positions.length / 2 || (zero && changes(positions));
    const rows = derived ? positions : velocities;
    if (!rows.length)
      throw new Error(
        `${topic.name}: no message has ${list(joints.right)} and ${list(joints.left)}, with velocities or positions; joints: ${list(new Set(topic.rows.flatMap((row) => row.data.name)))}`,
      );
    const without = topic.rows.length - rows.length;
    const how = `${derived ? 'positions' : 'velocities'} of ${list(joints.right)} and ${list(joints.left)}${without ? `; ${without} messages without both` : ''}`;
    return { topic, rows, derived, how };
  }

  // Rows of the robot's pose in the map, from all transforms.
  mapPoses() {
    const links = [...this.topics.values()]
      .filter((topic) => this.wants(topic.type) && isTf(topic) && !this.isForeign(topic.name))
      .flatMap((topic) => topic.rows.map((row) => ({ ...row, fixed: /static/.test(topic.name) })))
      .filter(({ data }) => !this.isForeign(data.name))
      .sort((a, b) => b.fixed - a.fixed || a.receiptUs - b.receiptUs);
    const base = ['base_footprint', 'base_link', 'base'].find((name) =>
      links.some(({ data }) => data.child === name),
    );
    const latest = new Map();
    const rows = [];
    for (const { data, fixed, ...times } of links) {
      latest.set(data.child, data);
      let [x, y, yaw, frame, moved] = [0, 0, 0, base, false];
      // A loop of frames ends, too.
      for (let depth = 0; latest.has(frame) && depth < latest.size; ++depth) {
        const { parent, at } = latest.get(frame);
        const [cos, sin] = [Math.cos(at[2]), Math.sin(at[2])];
        [x, y, yaw] = [at[0] + cos * x - sin * y, at[1] + sin * x + cos * y, yaw + at[2]];
        moved ||= frame === data.child;
        frame = parent;
      }
      const heading = Math.atan2(Math.sin(yaw), Math.cos(yaw));
      if (!fixed && moved && frame === 'map') rows.push({ ...times, data: [x, y, heading] });
    }
    return rows;
  }

  // Sets the time of each row, on the wheels' clock: stamps, or times of receipt where a topic has no
  // stamps or those of another clock.
  stamp(rows, name) {
    const stamped = rows.filter((row) => row.stampUs > 0);
    const usable =
      stamped.length > 0.9 * rows.length &&
      (rows.length === 1 || stamped.at(-1).stampUs > stamped[0].stampUs);
    const lateUs = usable ? median(stamped.map((row) => row.receiptUs - row.stampUs)) : 0;
    this.lateUs ??= lateUs;
    const trusted = usable && Math.abs(lateUs - this.lateUs) <= clockToleranceUs;
    if (usable && !trusted)
      this.warn(
        `${name}: its stamps are ${((this.lateUs - lateUs) / 1e6).toFixed(1)} s ahead of the wheels'; times of receipt are used`,
      );
    for (const row of rows)
      row.timeUs = Math.round(
        (trusted && row.stampUs > 0 ? row.stampUs : row.receiptUs - this.lateUs) + (this.shiftUs ?? 0),
      );
    rows.sort((a, b) => a.timeUs - b.timeUs);
  }

  holdS(role, rows) {
    const chosen = this.choices.hold_s?.[role];
    if (chosen) return chosen;
    const gaps = rows
      .slice(1)
      .map((row, k) => (row.timeUs - rows[k].timeUs) / 1e6)
      .sort((a, b) => a - b);
    // Not the median: a topic that is published on change has long pauses.
    return gaps.length && gaps.at(-1) > 0
      ? Math.min(1e6, holdPeriods * gaps[Math.floor(0.9 * (gaps.length - 1))] || 1e6)
      : 1e6;
  }

  // {files: name to text, mapping} for a recording called `stem`.
  tables(stem, robotId) {
    const wheels = this.wheels();
    this.stamp(wheels.rows, wheels.topic.name);
    // Simulated time counts from zero; the times of receipt may have the date.
    if (wheels.rows[0].timeUs < year2000Us && wheels.rows[0].timeUs + this.lateUs > year2000Us) {
      this.shiftUs = this.lateUs;
      for (const row of wheels.rows) row.timeUs += this.lateUs;
    }
    const time = { column: 't', unit: 'us' };
    const rate = wheels.derived ? { rate: { window_s: 0.1 } } : {};
    const fields = {
      wheel_velocity: [
        { column: 'right', ...rate },
        { column: 'left', ...rate },
      ],
    };
    const mapping = { robot_id: robotId, mission_id: stem, time, tables: {}, fields, covariates: {} };
    const payload = this.choices.payload_kg;
    if (payload !== undefined) mapping.payload_kg = payload;
    const files = new Map([[`${stem}.csv`, csv(['t', 'right', 'left'], wheels.rows)]]);
    const used = new Map([[wheels.topic, [`wheels: ${wheels.how}`]]]);
    const join = (role, topic, rows, columns, about = '', name = role) => {
      this.stamp(rows, topic.name);
      const hold = this.holdS(role, rows);
      files.set(`${stem}_${name}.csv`, csv(['t', ...columns], rows));
      mapping.tables[name] = { file: `{stem}_${name}.csv`, tolerance_s: hold, time };
      used.set(topic, [
        ...(used.get(topic) ?? []),
        `${role}${about}, a value holds for ${+hold.toPrecision(3)} s`,
      ]);
      return columns.map((column) => ({ column: `${name}:${column}` }));
    };

    const [battery, ...packs] = this.candidates('battery');
    if (battery) {
      packs.forEach(({ name }) =>
        this.warn(
          `${name}: packs in parallel to ${battery.name} are not added; --mapping with {"topics": {"battery": "${name}"}} uses it instead`,
        ),
      );
      const reversed = this.choices.battery_current === 'positive_discharging';
      const sign = `, current ${reversed ? 'positive' : 'negative'} while discharging`;
      const [volts, amps] = join('battery', battery, battery.rows, ['voltage', 'current'], sign);
      fields.battery_voltage = volts;
      fields.battery_current = reversed ? amps : { ...amps, negate: true };
      const mean = battery.rows.reduce((sum, { data }) => sum + (data[1] || 0), 0) / battery.rows.length;
      if (!battery.rows.some(({ data }) => Number.isFinite(data[1])))
        this.warn(`${battery.name}: its current is never a number: no power is measured`);
      if (reversed ? mean < 0 : mean > 0)
        this.warn(
          `${battery.name}: by its sign the battery charges, ${mean.toFixed(2)} A in the mean; if it did not: --mapping with {"battery_current": "${reversed ? 'positive_charging' : 'positive_discharging'}"}`,
        );
    }
    const [command] = this.candidates('command');
    if (command) fields.velocity_command = join('command', command, command.rows, ['v', 'w']);
    const [imu] = this.candidates('imu');
    if (imu) [fields.yaw_rate, fields.pitch] = join('imu', imu, imu.rows, ['yaw_rate', 'pitch']);
    for (const pose of this.candidates('pose')) {
      const rows = isTf(pose)
        ? this.mapPoses()
        : pose.rows.map((row) => ({ ...row, data: row.data.slice(0, 3) }));
      if (!rows.length) continue;
      fields.pose = join('pose', pose, rows, ['x', 'y', 'heading']);
      break;
    }
    const motors = {};
    for (const topic of this.topics.values()) {
      if (topic.kind !== 'sensor_msgs/Temperature' || !topic.rows.length || this.isForeign(topic.name))
        continue;
      const name = `${topic.name
        .slice(1)
        .replace(/[^\w.-]/g, '_')
        .slice(-45)}_c`;
      const [column] = join('temperature', topic, topic.rows, ['celsius'], ` ${name}`, name);
      const side = /motor|winding/i.test(name) && /(right|left)/i.exec(name)?.[1].toLowerCase();
      if (side) motors[side] = column;
      else mapping.covariates[name] = column;
    }
    if (motors.right && motors.left) fields.motor_temperature = [motors.right, motors.left];
    this.report = this.lines(used);
    return { files, mapping };
  }

  lines(used) {
    const others = [...this.topics.values()].filter((t) => !this.wants(t.type)).length;
    const found = [...this.topics.values()]
      .filter((t) => this.wants(t.type))
      .sort((a, b) => (a.name < b.name ? -1 : 1));
    const missing = Object.keys(preferences).filter(
      (role) => ![...used.values()].flat().some((text) => text.startsWith(role)),
    );
    return [
      ...found.map(
        (t) => `${t.name} (${t.type}, ${t.count} messages): ${used.get(t)?.join('; ') ?? 'not used'}`,
      ),
      ...(others ? [`${others} topics of other types`] : []),
      ...(missing.length ? [`not measured: ${missing.join(', ')}`] : []),
      ...this.warnings.map((text) => `warning: ${text}`),
    ];
  }
}

function csv(columns, rows) {
  return [columns, ...rows.map(({ timeUs, data }) => [timeUs, ...data])]
    .map((row) => `${row.join(',')}\n`)
    .join('');
}
