#include "missions.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "energy/meter.h"
#include "robot/robot_file.h"
#include "telemetry/log_recordings.h"
#include "tests/support/import_csv.h"
#include "tests/telemetry/temporary_file.h"

namespace joulecast::forecast {
namespace {

namespace fs = std::filesystem;
using signals::Sample;

enum class Commanded { stand, turn, drive };

Commanded commanded(const Sample& s) {
  if (s.velocity_command[0] != 0) return Commanded::drive;
  return s.velocity_command[1] != 0 ? Commanded::turn : Commanded::stand;
}

// The trapezoids that were commanded: of the greatest command, the way and the time of all.
std::vector<StatedLeg> commanded_plan(const telemetry::Recording& mission) {
  std::vector<StatedLeg> plan;
  const std::vector<Sample>& samples = mission.samples;
  for (std::size_t k = 0; k < samples.size();) {
    const Commanded kind = commanded(samples[k]);
    StatedLeg leg;
    leg.leg.payload_kg = mission.payload_kg;
    leg.leg.motion = static_cast<Motion>(kind == Commanded::stand ? 0 : kind == Commanded::drive ? 1 : 2);
    double turned = 0, duration_s = 0;
    for (; k < samples.size() && commanded(samples[k]) == kind; ++k) {
      const double h = k + 1 < samples.size()
                           ? 1e-6 * static_cast<double>(samples[k + 1].utime_us - samples[k].utime_us)
                           : 0;
      const double now = std::fabs(samples[k].velocity_command[kind == Commanded::turn ? 1 : 0]);
      if (kind == Commanded::stand) leg.leg.duration_s += h;
      leg.leg.way += now * h;
      duration_s += h;
      turned += samples[k].velocity_command[1] * h;
      leg.speed = std::max(leg.speed, now);
    }
    if (kind == Commanded::drive) leg.leg.curvature_1_m = std::fabs(turned) / leg.leg.way;
    if (kind != Commanded::stand) {
      if (!(leg.leg.way > 0)) continue;
      leg.acceleration = leg.speed / std::max(least_ramp_s, duration_s - leg.leg.way / leg.speed);
    }
    plan.push_back(leg);
  }
  return plan;
}

std::vector<StatedLeg> driven_plan(const std::vector<Leg>& legs) {
  std::vector<StatedLeg> plan;
  for (const Leg& leg : legs) {
    StatedLeg stated{{leg.motion, leg.way, leg.curvature_1_m, leg.payload_kg, 0}, leg.speed, 0};
    if (leg.motion == Motion::stand)
      stated.leg.duration_s = leg.duration_s;
    else
      stated.acceleration = leg.speed / std::max(least_ramp_s, leg.duration_s - leg.way / leg.speed);
    plan.push_back(stated);
  }
  return plan;
}

}  // namespace

std::vector<DrivenMission> driven(const robot::RobotModel& robot, const dynamics::DriveModel& drive,
                                  std::span<const telemetry::Recording> recordings) {
  std::vector<DrivenMission> missions;
  LegTracker tracker(robot);
  double distance_m = 0;
  energy::Meter meter(drive, {}, [&](const energy::MeterPoint& p) {
    distance_m += std::fabs(p.speed_m_s) * p.interval_s;
    tracker.add({p.bridged ? p.interval_s : 0, p.speed_m_s, p.yaw_rate_rad_s, p.measured_power_w,
                 p.sample.payload_kg, p.sample.velocity_command});
  });
  for (const telemetry::Recording& recording : recordings) {
    if (recording.samples.empty()) continue;
    meter.begin();
    tracker.begin();
    distance_m = 0;
    for (const Sample& sample : recording.samples) (void)meter.add(sample);
    (void)meter.flush();
    DrivenMission m;
    const std::int64_t start = recording.samples.front().utime_us;
    m.past = {start, tracker.take()};
    m.metered_j = m.true_j = meter.accounts().measured_j;
    m.duration_s = 1e-6 * static_cast<double>(recording.samples.back().utime_us - start);
    m.distance_m = distance_m;
    missions.push_back(std::move(m));
  }
  return missions;
}

std::optional<RobotRun> recorded_fleet_robot(const std::string& directory) {
  const std::string log = telemetry::test::read_packed_text(fs::path(directory) / "telemetry.lcmlog.gz");
  if (log.empty()) return std::nullopt;
  const telemetry::test::TemporaryFile file;
  file.put({reinterpret_cast<const std::uint8_t*>(log.data()), log.size()});
  const std::string paths[] = {file.path()};
  const auto read = telemetry::read_recordings(paths);
  auto robot = robot::parse_robot(telemetry::test::read_text(fs::path(directory) / "robot.json"));
  if (!read || !robot) return std::nullopt;
  RobotRun run{fs::path(directory).filename().string(), *robot, *dynamics::drive_model(*robot), {}};
  std::vector<telemetry::Recording> declared;
  for (const telemetry::Recording& r : read->recordings)
    if (!r.implicit && !r.samples.empty()) declared.push_back(r);
  run.missions = driven(run.robot, run.drive, declared);
  for (std::size_t k = 0; k < declared.size(); ++k) run.missions[k].plan = commanded_plan(declared[k]);
  return run;
}

std::optional<RobotRun> recorded_tables(const std::string& directory, const std::string& robot_file,
                                        const std::string& mapping_file) {
  const auto mapping = telemetry::ImportMapping::parse(telemetry::test::read_text(mapping_file));
  auto robot = robot::parse_robot(telemetry::test::read_text(robot_file));
  std::vector<fs::path> tables;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(directory, none))
    if (entry.path().extension() == ".csv") tables.push_back(entry.path());
  if (!mapping || !robot || tables.empty()) return std::nullopt;
  std::ranges::sort(tables);
  std::vector<telemetry::Recording> recordings;
  telemetry::ImportOptions options;
  options.start_utime_us = 1'700'000'000'000'000;
  for (const fs::path& table : tables) {
    options.source_name = table.string();
    auto import = telemetry::import_csv(telemetry::test::read_text(table), *mapping, options);
    if (!import) continue;
    *options.start_utime_us = import->recording.samples.back().utime_us + 60'000'000;
    import->recording.payload_kg = 0;
    recordings.push_back(std::move(import->recording));
  }
  RobotRun run{fs::path(directory).filename().string(), *robot, *dynamics::drive_model(*robot), {}};
  run.missions = driven(run.robot, run.drive, recordings);
  for (DrivenMission& mission : run.missions) mission.plan = driven_plan(mission.past.legs);
  return run;
}

}  // namespace joulecast::forecast
