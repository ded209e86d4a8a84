#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "gap/groups/comparer.h"
#include "gap/runs/run_referee.h"
#include "gap/runs/run_search.h"

namespace joulecast::gap {

namespace {

// The label that makes the groups is no cause beside them.
RunSet without_own_label(RunSet set, std::span<const std::string> group_of_run) {
  for (std::size_t l = 0; l < set.labels.size(); ++l) {
    bool same = true;
    for (std::size_t k = 0; k < set.runs.size(); ++k) same = same && set.runs[k].labels[l] == group_of_run[k];
    if (!same) continue;
    for (MissionRun& run : set.runs) run.labels[l].clear();
  }
  return set;
}

// Runs with the group of each.
struct GroupedRuns {
  const RunSet& set;
  const RunColumns& columns;
  const std::vector<std::size_t>& block;
  const std::vector<std::size_t>& group;

  // The plain regression of each group alone, on what the model misses of each run in use.
  std::vector<double> regression(const RunReferee& referee, const std::vector<double>& missed,
                                 const std::vector<bool>& use) const {
    std::vector<double> answer(missed.size(), 0);
    for (std::size_t g = 0; g <= *std::ranges::max_element(group); ++g) {
      std::vector<bool> out(missed.size());
      for (std::size_t k = 0; k < out.size(); ++k) out[k] = !use[k] || group[k] != g;
      const std::vector<double> own = referee.fit(missed, out).energy_j;
      for (std::size_t k = 0; k < out.size(); ++k) {
        if (group[k] == g) answer[k] = own[k];
      }
    }
    return answer;
  }

  std::vector<Item> items(std::vector<ComparedGroup>& groups) const {
    std::vector<Item> items;
    for (std::size_t k = 0; k < block.size(); ++k) {
      const double measured = set.runs[k].measured_j(), way_m = set.runs[k].at.distance_m;
      items.push_back({group[k], block[k], measured, 1 / std::max(measured, columns.size_j(k)), 1, way_m,
                       columns.modelled(k, {}).duration_s});
      ComparedGroup& g = groups[group[k]];
      ++g.missions, ++g.samples;
      g.way_m += way_m;
      g.energy_per_m_j += measured;
    }
    for (ComparedGroup& g : groups) g.energy_per_m_j /= g.way_m;
    return items;
  }
};

void describe(const RunColumns& columns, double scatter, Diagnosis& d) {
  d.missions = d.samples = columns.runs().size();
  d.motor_channels = columns.by_motor();
  d.power = d.motor_channels ? PowerSource::motors : PowerSource::battery;
  d.noise_floor = std::sqrt(2 / std::numbers::pi) * scatter;
}

}  // namespace

Result<Comparison> compare_runs(const RunSet& set, std::span<const std::string> group_of_run,
                                const robot::RobotModel& robot, const CompareSettings& settings) {
  auto adopted = dynamics::active_effects(robot);
  if (!adopted) return tl::unexpected(adopted.error());
  const std::set<std::string> names(group_of_run.begin(), group_of_run.end());
  if (names.size() < 2) return invalid("--compare-by", "gives one group only; two are needed to compare");
  Comparison c;
  for (const std::string& name : names) c.groups.push_back({name, 0, 0, 0, 0, 0});
  std::vector<std::size_t> group;
  for (const std::string& name : group_of_run)
    group.push_back(static_cast<std::size_t>(std::distance(names.begin(), names.find(name))));

  const RunSet compared = without_own_label(set, group_of_run);
  RunColumns columns(compared, robot, *std::move(adopted));
  const std::vector<std::size_t> block = blocks_of(compared.runs, group_of_run);
  // Differences are judged around what one finds in all runs.
  const std::vector<Cause> around = search_runs(columns, block).causes;
  columns.linearise_around(around);
  const RunReferee referee(columns);
  const GroupedRuns runs{compared, columns, block, group};

  GroupedData data{robot};
  data.without = [&](const std::vector<bool>& out) {
    std::vector<bool> runs_out(out.empty() ? 0 : block.size());
    for (std::size_t k = 0; k < runs_out.size(); ++k) runs_out[k] = out[block[k]];
    return make_problem(columns, learn_scatter(columns, runs_out, group), block);
  };
  const RunScatter scatter = learn_scatter(columns, {}, group);
  data.base = make_problem(columns, scatter, block);
  data.explain.most_families = 1;
  data.explain.candidate = true;
  data.around = around;
  data.explain.most_members = 2;
  data.group_of_block.resize(1 + *std::ranges::max_element(block));
  for (std::size_t k = 0; k < block.size(); ++k) data.group_of_block[block[k]] = group[k];
  data.items = runs.items(c.groups);
  data.cause = [&](std::size_t h, const Eigen::VectorXd& coefficients) {
    return columns.causes_of({h}, coefficients).front();
  };
  data.predict = [&](const std::vector<std::vector<Cause>>& by_group) {
    std::vector<double> energies;
    for (std::size_t k = 0; k < block.size(); ++k)
      energies.push_back(columns.modelled(k, by_group[group[k]]).sum_j);
    return energies;
  };
  data.referee = [&](const std::vector<double>& missed, const std::vector<bool>& use) {
    return runs.regression(referee, missed, use);
  };
  c.diagnosis.robot_id = robot.robot_id;
  describe(columns, scatter.run, c.diagnosis);
  c.limits.emplace_back(
      "A group is what its name says and whatever else was different: day, payload, tyres, batteries, "
      "weather.");
  if (!compare_groups(data, settings, c)) return fail(Fault::conflict, "", "comparison cancelled");
  c.diagnosis.channels = {{c.diagnosis.motor_channels ? "motor_power" : "battery_power",
                           c.diagnosis.power_absolute_relative, c.diagnosis.noise_floor}};
  return c;
}

}  // namespace joulecast::gap
