// Write and query performance of a store; see scale.md.
//
// scale write POSTGRES_URL SQLITE_PATH [SECONDS]
//   rows, missions and processor time per sample of both stores, compared with a bare COPY loop
// scale fill POSTGRES_URL MISSIONS ROBOTS DAYS
//   writes missions of an invented past through SQL
// scale ask POSTGRES_URL
//   times of lists and totals
#include <dirent.h>
#include <libpq-fe.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "history/chunk_codec.h"
#include "history/mission_days.h"
#include "history/open_store.h"
#include "history/postgres.h"
#include "history/sql_rows.h"

namespace joulecast::history {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::int64_t second_us = 1'000'000;
constexpr int robots = 2000, samples_a_second = 10;

template <class T>
T need(Result<T> result) {
  if (!result) throw std::runtime_error(describe(result.error()));
  return std::move(*result);
}

double seconds_since(Clock::time_point began) {
  return std::chrono::duration<double>(Clock::now() - began).count();
}

std::int64_t host_now_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Fields 4, 14 and 15 of /proc/PID/stat: the parent and the processor time used.
bool read_stat(const std::string& pid, long& parent, double& cpu_s) {
  std::ifstream file("/proc/" + pid + "/stat");
  std::string text;
  if (!std::getline(file, text)) return false;
  std::istringstream rest(text.substr(text.rfind(')') + 2));
  std::vector<std::string> fields;
  for (std::string field; rest >> field;) fields.push_back(field);
  parent = std::stol(fields[1]);
  cpu_s = static_cast<double>(std::stol(fields[11]) + std::stol(fields[12])) /
          static_cast<double>(sysconf(_SC_CLK_TCK));
  return true;
}

double own_cpu_s() {
  long parent = 0;
  double cpu_s = 0;
  read_stat("self", parent, cpu_s);
  return cpu_s;
}

// Processor time of all processes of the server behind a connection on this machine.
double server_cpu_s(PostgresDatabase& database) {
  long postmaster = 0;
  double sum_s = 0;
  read_stat(std::to_string(database.integer("SELECT pg_backend_pid()")), postmaster, sum_s);
  sum_s = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string pid = entry.path().filename();
    long parent = 0;
    double cpu_s = 0;
    if (pid.find_first_not_of("0123456789") == std::string::npos && read_stat(pid, parent, cpu_s) &&
        parent == postmaster)
      sum_s += cpu_s;
  }
  return sum_s;
}

std::vector<signals::Sample> samples_from(std::int64_t utime_us, std::int64_t sequence, int count) {
  std::vector<signals::Sample> samples(static_cast<std::size_t>(count));
  for (int k = 0; k < count; ++k) {
    auto& s = samples[static_cast<std::size_t>(k)];
    s.utime_us = utime_us + k * second_us / samples_a_second;
    s.sequence = sequence + k;
    const double wave = static_cast<double>((sequence + k) % 97);
    s.battery_voltage_v = 24 + 0.01 * wave;
    s.battery_current_a = 3 + 0.1 * wave;
    s.wheel_velocity_rad_s = {5 + 0.03 * wave, 5 - 0.02 * wave};
    s.motor_current_a = {1 + 0.01 * wave, 1 - 0.01 * wave};
  }
  return samples;
}

TraceBucket bucket_of(std::int64_t start_utime_us, double energy_j) {
  TraceBucket bucket;
  bucket.start_utime_us = start_utime_us;
  bucket.covered_s = 1;
  bucket.measured_power_w = bucket.modelled_power_w = {70.1, 72.3, 75.9};
  bucket.speed_m_s = {0.31, 0.52, 0.67};
  bucket.state_of_charge = 0.83;
  bucket.measured_j = bucket.modelled_j = energy_j;
  bucket.x_m = bucket.y_m = 12.345;
  return bucket;
}

struct Measure {
  std::int64_t rows = 0, samples = 0, missions = 0;
  double wall_s = 0, cpu_s = 0;
};

void print(const char* what, const Measure& m) {
  std::printf("%-34s %9.0f rows/s %9.0f samples/s", what, static_cast<double>(m.rows) / m.wall_s,
              static_cast<double>(m.samples) / m.wall_s);
  if (m.missions > 0) std::printf(" %7.1f missions/s", static_cast<double>(m.missions) / m.wall_s);
  std::printf("  %6.2f us of processor a sample\n", 1e6 * m.cpu_s / static_cast<double>(m.samples));
  std::fflush(stdout);
}

std::string robot_name(int robot) {
  return "amr-" + std::to_string(100'000 + robot);
}

// The checkpoints of each robot and second: one row each of the mission, its trace, its telemetry and the
// robot's state. In batches of 0.2 s.
Measure stream(Store& store, const std::function<double()>& cpu_s, double for_s) {
  const std::int64_t start = host_now_us() / second_us * second_us;
  std::vector<Mission> missions(robots);
  std::vector<Command> starts;
  const std::string name = "stream " + std::to_string(start);
  for (int r = 0; r < robots; ++r) {
    Mission& m = missions[static_cast<std::size_t>(r)];
    m.robot_id = robot_name(r);
    m.mission_id = name;
    m.start_utime_us = m.end_utime_us = start;
    m.key = need(store.new_mission_key());
    starts.push_back(StartMission{m});
  }
  need(store.apply(starts));
  Measure measure;
  const double cpu_before = cpu_s();
  const auto began = Clock::now();
  for (std::int64_t second = 0; seconds_since(began) < for_s; ++second) {
    for (int part = 0; part < 5; ++part) {
      std::vector<Command> batch;
      for (int r = part * robots / 5; r < (part + 1) * robots / 5; ++r) {
        Mission& m = missions[static_cast<std::size_t>(r)];
        const std::int64_t at = start + second * second_us;
        m.end_utime_us = at + second_us;
        m.samples += samples_a_second;
        m.accounts.measured_j += 72;
        ResumeState state;
        state.robot_id = m.robot_id;
        state.utime_us = at;
        batch.push_back(CheckpointMission{
            m, {bucket_of(at, m.accounts.measured_j)}, samples_from(at, m.samples, samples_a_second), state});
      }
      for (const Outcome& outcome : need(store.apply(batch))) need(outcome);
      measure.rows += 4 * static_cast<std::int64_t>(batch.size());
      measure.samples += samples_a_second * static_cast<std::int64_t>(batch.size());
      if (seconds_since(began) >= for_s) break;
    }
  }
  measure.wall_s = seconds_since(began);
  measure.cpu_s = cpu_s() - cpu_before;
  return measure;
}

constexpr int mission_s = 300;

Mission ended_mission(std::int64_t start_utime_us, int robot) {
  Mission m;
  m.robot_id = robot_name(robot);
  m.mission_id = "whole " + std::to_string(start_utime_us);
  m.start_utime_us = start_utime_us;
  m.end_utime_us = start_utime_us + mission_s * second_us;
  m.samples = mission_s * samples_a_second;
  m.accounts.measured_j = 21600;
  m.accounts.measured_s = mission_s;
  m.state = MissionState::finished;
  return m;
}

// Whole missions of five minutes, ten per batch, as in an import.
Measure whole_missions(Store& store, const std::function<double()>& cpu_s, double for_s) {
  Measure measure;
  std::int64_t start = host_now_us() / second_us * second_us - 3600 * second_us;
  const double cpu_before = cpu_s();
  const auto began = Clock::now();
  while (seconds_since(began) < for_s) {
    std::vector<Command> batch;
    for (int k = 0; k < 10; ++k) {
      Mission m = ended_mission(start + k * second_us, k);
      m.key = need(store.new_mission_key());
      Mission begun = m;
      begun.state = MissionState::open;
      batch.push_back(StartMission{begun});
      std::vector<TraceBucket> trace;
      for (int s = 0; s < mission_s; ++s)
        trace.push_back(bucket_of(m.start_utime_us + s * second_us, 72.0 * s));
      batch.push_back(CheckpointMission{
          m, trace, samples_from(m.start_utime_us, 0, mission_s * samples_a_second), std::nullopt});
      measure.rows += 1 + mission_s + 3;
    }
    for (const Outcome& outcome : need(store.apply(batch))) need(outcome);
    start -= 100 * second_us;
    measure.missions += 10;
    measure.samples += 10 * mission_s * samples_a_second;
  }
  measure.wall_s = seconds_since(began);
  measure.cpu_s = cpu_s() - cpu_before;
  return measure;
}

// The same rows by COPY in text format, into tables with the same columns and primary keys only.
class BareCopy {
 public:
  explicit BareCopy(PostgresDatabase& database) : database_(database) {
    for (const std::string table : {"mission", "trace", "telemetry_chunk", "energy_state"}) {
      database.execute("DROP TABLE IF EXISTS bare_" + table);
      database.execute("CREATE TABLE bare_" + table + " (LIKE " + table +
                       " INCLUDING DEFAULTS INCLUDING STORAGE)");
    }
    database.execute("ALTER TABLE bare_mission ADD n BIGSERIAL PRIMARY KEY");
    database.execute("ALTER TABLE bare_energy_state ADD n BIGSERIAL PRIMARY KEY");
    database.execute("ALTER TABLE bare_trace ADD PRIMARY KEY (mission_key, start_utime_us)");
    database.execute(
        "ALTER TABLE bare_telemetry_chunk ALTER chunk_key DROP NOT NULL, ADD PRIMARY KEY (mission_key, "
        "first_ordinal)");
  }
  ~BareCopy() {
    for (const std::string table : {"mission", "trace", "telemetry_chunk", "energy_state"})
      database_.execute("DROP TABLE bare_" + table);
  }

  void mission(const Mission& m) {
    mission_ += std::to_string(m.key) + '\t' + m.robot_id + '\t' + m.mission_id + '\t' +
                std::to_string(m.start_utime_us) + '\t' + std::to_string(m.end_utime_us) +
                "\topen\t0\t0\t\t\t" + std::to_string(m.samples) + "\t{}\t0";
    for (int k = 0; k < 31; ++k) mission_ += "\t21600.25";
    mission_ += '\n';
  }
  void trace(const Mission& m, const TraceBucket& b) {
    trace_ += std::to_string(m.key) + '\t' + std::to_string(b.start_utime_us);
    for (const double value :
         {b.covered_s, b.measured_power_w.min, b.measured_power_w.mean, b.measured_power_w.max,
          b.modelled_power_w.min, b.modelled_power_w.mean, b.modelled_power_w.max, b.speed_m_s.min,
          b.speed_m_s.mean, b.speed_m_s.max, b.state_of_charge, b.measured_j, b.modelled_j, b.x_m, b.y_m})
      add(trace_, value);
    trace_ += '\n';
  }
  void telemetry(const Mission& m, std::int64_t ordinal, const std::vector<signals::Sample>& samples,
                 int level) {
    const std::vector<std::byte> body = encode_chunk(samples, level);
    const std::string size = std::to_string(samples.size()), from = std::to_string(samples.front().utime_us),
                      to = std::to_string(samples.back().utime_us);
    chunks_ += std::to_string(m.key) + '\t' + std::to_string(ordinal) + '\t' + size + '\t' + from + '\t' +
               to + '\t' + to + "\t1\t" + std::to_string(body.size()) + "\t\\\\x";
    constexpr char digits[] = "0123456789abcdef";
    for (const std::byte byte : body) {
      chunks_ += digits[std::to_integer<unsigned>(byte) >> 4U];
      chunks_ += digits[std::to_integer<unsigned>(byte) & 15U];
    }
    chunks_ += '\n';
  }
  void state(const std::string& robot_id, std::int64_t utime_us) {
    states_ += robot_id + '\t' + std::to_string(utime_us) + "\t1\t0.83\t40.5\t40.25\n";
  }
  void commit() {
    database_.execute("BEGIN");
    static const std::string mission_columns = [] {
      std::string text =
          "mission_key, robot_id, mission_id, start_utime_us, end_utime_us, state, implicit, incomplete, "
          "incomplete_reason, note, samples, sample_faults, gap_count, " +
          columns_of<signals::Accounts>();
      return text;
    }();
    copy("mission", mission_columns, mission_);
    copy("trace", "mission_key, " + columns_of<TraceBucket>(), trace_);
    copy("telemetry_chunk",
         "mission_key, first_ordinal, samples, start_utime_us, end_utime_us, stored_utime_us, "
         "sealed, bytes, body",
         chunks_);
    copy("energy_state",
         "robot_id, utime_us, sequence, state_of_charge, winding_temperature_right_c, "
         "winding_temperature_left_c",
         states_);
    database_.execute("COMMIT");
  }

 private:
  static void add(std::string& text, double value) {
    char digits[32];
    text += '\t';
    text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  }
  void copy(const std::string& table, const std::string& columns, std::string& rows) {
    if (rows.empty()) return;
    PGconn* connection = database_.handle();
    PQclear(PQexec(connection, ("COPY bare_" + table + " (" + columns + ") FROM STDIN").c_str()));
    if (PQputCopyData(connection, rows.data(), static_cast<int>(rows.size())) != 1 ||
        PQputCopyEnd(connection, nullptr) != 1)
      throw std::runtime_error(PQerrorMessage(connection));
    while (PGresult* result = PQgetResult(connection)) {
      if (PQresultStatus(result) != PGRES_COMMAND_OK) throw std::runtime_error(PQresultErrorMessage(result));
      PQclear(result);
    }
    rows.clear();
  }

  PostgresDatabase& database_;
  std::string mission_, trace_, chunks_, states_;
};

Measure stream_by_copy(PostgresDatabase& database, const std::function<double()>& cpu_s, double for_s) {
  BareCopy copy(database);
  Measure measure;
  const std::int64_t start = host_now_us() / second_us * second_us;
  const double cpu_before = cpu_s();
  const auto began = Clock::now();
  for (std::int64_t second = 0; seconds_since(began) < for_s; ++second) {
    for (int part = 0; part < 5 && seconds_since(began) < for_s; ++part) {
      for (int r = part * robots / 5; r < (part + 1) * robots / 5; ++r) {
        Mission m = ended_mission(start, r);
        m.key = r + 1;
        const std::int64_t at = start + second * second_us;
        copy.mission(m);
        copy.trace(m, bucket_of(at, 72));
        copy.telemetry(m, second * samples_a_second,
                       samples_from(at, second * samples_a_second, samples_a_second), 1);
        copy.state(m.robot_id, at);
        measure.rows += 4;
        measure.samples += samples_a_second;
      }
      copy.commit();
    }
  }
  measure.wall_s = seconds_since(began);
  measure.cpu_s = cpu_s() - cpu_before;
  return measure;
}

Measure missions_by_copy(PostgresDatabase& database, const std::function<double()>& cpu_s, double for_s) {
  BareCopy copy(database);
  Measure measure;
  std::int64_t start = host_now_us() / second_us * second_us - 3600 * second_us;
  const double cpu_before = cpu_s();
  const auto began = Clock::now();
  while (seconds_since(began) < for_s) {
    for (int k = 0; k < 10; ++k) {
      Mission m = ended_mission(start + k * second_us, k);
      m.key = ++measure.missions;
      copy.mission(m);
      for (int s = 0; s < mission_s; ++s)
        copy.trace(m, bucket_of(m.start_utime_us + s * second_us, 72.0 * s));
      const auto samples = samples_from(m.start_utime_us, 0, mission_s * samples_a_second);
      for (std::size_t from = 0; from < samples.size(); from += 1024)
        copy.telemetry(m, static_cast<std::int64_t>(from),
                       {samples.begin() + static_cast<long>(from),
                        samples.begin() + static_cast<long>(std::min(from + 1024, samples.size()))},
                       3);
      measure.rows += 1 + mission_s + 3;
      measure.samples += mission_s * samples_a_second;
    }
    copy.commit();
    start -= 100 * second_us;
  }
  measure.wall_s = seconds_since(began);
  measure.cpu_s = cpu_s() - cpu_before;
  return measure;
}

void write(const std::string& url, const std::string& path, double for_s) {
  const auto postgres = need(open_store(url));
  const auto sqlite = need(open_store(path));
  PostgresDatabase database(url, "scale");
  const auto both = [&] { return own_cpu_s() + server_cpu_s(database); };
  struct Row {
    const char* what;
    Measure copy, postgres, sqlite;
  };
  const Row rows[] = {{"2,000 robots, a checkpoint a second", stream_by_copy(database, both, for_s),
                       stream(*postgres, both, for_s), stream(*sqlite, own_cpu_s, for_s)},
                      {"whole missions of 300 s", missions_by_copy(database, both, for_s),
                       whole_missions(*postgres, both, for_s), whole_missions(*sqlite, own_cpu_s, for_s)}};
  for (const Row& row : rows) {
    std::printf("%s\n", row.what);
    print("  bare COPY loop", row.copy);
    print("  PostgreSQL", row.postgres);
    print("  SQLite", row.sqlite);
    const auto rate = [](const Measure& m) { return static_cast<double>(m.samples) / m.wall_s; };
    const auto cost = [](const Measure& m) { return m.cpu_s / static_cast<double>(m.samples); };
    std::printf("  PostgreSQL to COPY %.2f (by processor time %.2f), PostgreSQL to SQLite %.2f\n",
                rate(row.postgres) / rate(row.copy), cost(row.copy) / cost(row.postgres),
                rate(row.postgres) / rate(row.sqlite));
  }
}

void fill(const std::string& url, std::int64_t missions, std::int64_t of_robots, std::int64_t days) {
  need(open_store(url)).reset();
  PostgresDatabase database(url, "scale");
  const auto began = Clock::now();
  const std::string n = std::to_string(of_robots);
  database.execute(
      "INSERT INTO robot (robot_id, created_utime_us) SELECT 'amr-' || 100000 + n, 1 FROM "
      "generate_series(0, " +
      n + " - 1) AS n ON CONFLICT DO NOTHING");
  const std::int64_t first = host_now_us() / day_us * day_us - days * day_us,
                     had = database.integer("SELECT count(*) FROM mission");
  std::string values;
  for (int k = 0; k < 31; ++k) values += ", 1000 + (n * " + std::to_string(7919 + k) + ") % 997 * 0.37";
  constexpr std::int64_t at_once = 200'000;
  for (std::int64_t from = had; from < missions; from += at_once) {
    const std::int64_t to = std::min(missions, from + at_once);
    // In order of arrival: by time.
    database.execute(
        "INSERT INTO mission (mission_key, robot_id, mission_id, start_utime_us, end_utime_us, state, "
        "implicit, incomplete, "
        "incomplete_reason, note, samples, sample_faults, gap_count, gap_s, telemetry_samples, " +
        columns_of<signals::Accounts>() + ") SELECT n + 1, 'amr-' || 100000 + (n * 7919) % " + n +
        ", 'mission-' || n, t, t + 240000000, CASE n % 50 WHEN 0 THEN "
        "'aborted' ELSE 'finished' END, 0, 0, '', '', 2400, '{}', 0, 0, 0" +
        values + " FROM (SELECT n, " + std::to_string(first) + " + n * " +
        std::to_string(days * day_us / missions) + " AS t FROM generate_series(" + std::to_string(from) +
        "::bigint, " + std::to_string(to) + " - 1) AS n) AS made");
    std::printf("%lld missions after %.0f s\n", static_cast<long long>(to), seconds_since(began));
    std::fflush(stdout);
  }
  const auto adding_up = Clock::now();
  Transaction transaction(database, Database::Access::write);
  add_up_all_days(database);
  transaction.commit();
  database.execute("VACUUM ANALYZE mission");
  database.execute("VACUUM ANALYZE mission_day");
  std::printf(
      "added up by the day and analysed in %.0f s; mission %lld MB with its indexes, mission_day %lld MB\n",
      seconds_since(adding_up),
      static_cast<long long>(database.integer("SELECT pg_total_relation_size('mission')") / 1'000'000),
      static_cast<long long>(database.integer("SELECT pg_total_relation_size('mission_day')") / 1'000'000));
}

// Repeats a query and measures its duration and the server's processor time, which is more reliable on a busy
// machine.
class Questions {
 public:
  explicit Questions(PostgresDatabase& database) : database_(database) {}

  template <class Ask>
  void ask(const char* what, double limit_ms, Ask one) {
    constexpr int times = 41;
    std::vector<double> times_ms;
    const double cpu_before = server_cpu_s(database_);
    for (int k = 0; k < times; ++k) {
      const auto began = Clock::now();
      one(k);
      times_ms.push_back(1e3 * seconds_since(began));
    }
    const double cpu_ms = 1e3 * (server_cpu_s(database_) - cpu_before) / times;
    std::sort(times_ms.begin(), times_ms.end());
    std::printf("%-48s least %8.2f  median %8.2f  worst %8.2f ms  processor %7.2f ms", what, times_ms.front(),
                times_ms[times / 2], times_ms.back(), cpu_ms);
    if (limit_ms > 0)
      std::printf("  limit %.0f ms: %s", limit_ms, times_ms[times / 2] <= limit_ms ? "kept" : "NOT KEPT");
    std::printf("\n");
    std::fflush(stdout);
  }

 private:
  PostgresDatabase& database_;
};

void ask(const std::string& url) {
  const auto store = need(open_store(url));
  PostgresDatabase database(url, "scale");
  Questions questions(database);
  const auto time = [&](const char* what, double limit_ms, auto one) { questions.ask(what, limit_ms, one); };
  const std::int64_t today = host_now_us() / day_us * day_us;
  MissionFilter robot, month, robot_month;
  robot.robot_ids = {robot_name(17)};
  month.started.from_utime_us = today - 30 * day_us;
  robot_month = month;
  robot_month.robot_ids = robot.robot_ids;
  std::printf("%lld missions\n", static_cast<long long>(need(store->size()).missions));
  time("list, newest 50", 10, [&](int) { need(store->missions({}, {50, {}}, {})); });
  std::string cursor = need(store->missions({}, {50, {}}, {})).next_cursor;
  time("list, pages further back", 10, [&](int) {
    cursor = need(store->missions({}, {50, cursor}, {})).next_cursor;
  });
  time("list of one robot", 10, [&](int) { need(store->missions(robot, {50, {}}, {})); });
  time("list of a day of one robot, oldest first", 10, [&](int k) {
    MissionFilter day = robot;
    day.started.from_utime_us = today - (k + 1) * day_us;
    need(store->missions(day, {50, {}}, {MissionOrder::start, true}));
  });
  time("totals of one robot by day, all time", 50,
       [&](int) { need(store->grouped_totals(robot, Grouping::day, 0)); });
  time("totals of one robot by day, 30 days", 50,
       [&](int) { need(store->grouped_totals(robot_month, Grouping::day, 0)); });
  time("totals by robot, 30 days", 50, [&](int) { need(store->grouped_totals(month, Grouping::robot, 0)); });
  time("totals of the fleet by day, 30 days", 50,
       [&](int) { need(store->grouped_totals(month, Grouping::day, 0)); });
  time("totals by robot, all time", 0, [&](int) { need(store->grouped_totals({}, Grouping::robot, 0)); });
  time("totals of the fleet by day, all time", 0,
       [&](int) { need(store->grouped_totals({}, Grouping::day, 0)); });
  time("totals of one robot by day of UTC+1, 30 days", 50,
       [&](int) { need(store->grouped_totals(robot_month, Grouping::day, 3600)); });
  time("list sorted by energy (no index)", 0, [&](int) {
    need(store->missions(month, {50, {}}, {MissionOrder::energy}));
  });
  time("size", 0, [&](int) { need(store->size()); });
}

}  // namespace
}  // namespace joulecast::history

int main(int argc, char** argv) {
  using namespace joulecast::history;
  const std::string what = argc > 1 ? argv[1] : "";
  try {
    if (what == "write" && argc >= 4) return write(argv[2], argv[3], argc > 4 ? std::atof(argv[4]) : 10), 0;
    if (what == "fill" && argc == 6)
      return fill(argv[2], std::atoll(argv[3]), std::atoll(argv[4]), std::atoll(argv[5])), 0;
    if (what == "ask" && argc == 3) return ask(argv[2]), 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  std::fprintf(stderr,
               "scale write POSTGRES_URL SQLITE_PATH [SECONDS] | fill POSTGRES_URL MISSIONS ROBOTS DAYS | "
               "ask POSTGRES_URL\n");
  return 2;
}
