// Requirements on every store, in any database.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <set>
#include <thread>
#include <tuple>

#include "history/audit.h"
#include "history/spool.h"
#include "store_kind.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

using signals::CovariateChange;
using signals::Sample;

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class StoreConformance : public ::testing::TestWithParam<StoreKind> {
 protected:
  void SetUp() override { reopen(); }

  void reopen() {
    store_.reset();
    store_ = GetParam().open(folder_, [this] { return now_utime_us_; });
  }

  Outcome apply(const Command& command) { return apply_one(*store_, command); }

  // Ended missions m0, m1, ... of one robot, a second apart from 1000 s on.
  std::vector<Mission> add_missions(const std::string& robot_id, int count) {
    std::vector<Mission> missions;
    for (int i = 0; i < count; ++i) {
      Mission m = start_mission(*store_, robot_id, "m" + std::to_string(i), (1000 + i) * 1'000'000LL);
      m.state = MissionState::finished;
      m.payload_kg = i;
      m.accounts.measured_j = 10.0 * i;
      m.accounts.measured_s = 5;
      need(apply(CheckpointMission{m, {}, {}, {}}));
      missions.push_back(m);
    }
    return missions;
  }

  std::vector<MissionKey> walk(const MissionFilter& filter, std::int64_t limit) {
    std::vector<MissionKey> keys;
    PageRequest page{limit, {}};
    do {
      const MissionPage got = need(store_->missions(filter, page));
      EXPECT_LE(static_cast<std::int64_t>(got.missions.size()), limit);
      for (const Mission& m : got.missions) keys.push_back(m.key);
      page.cursor = got.next_cursor;
    } while (!page.cursor.empty());
    return keys;
  }

  std::vector<Sample> all_samples(MissionKey key, TimeRange range = {}, std::int64_t limit = 100'000) {
    std::vector<Sample> samples;
    PageRequest page{limit, {}};
    do {
      const TelemetryPage got = need(store_->telemetry(key, range, page));
      samples.insert(samples.end(), got.items.begin(), got.items.end());
      page.cursor = got.next_cursor;
    } while (!page.cursor.empty());
    return samples;
  }

  std::vector<CovariateChange> all_changes(MissionKey key, TimeRange range = {},
                                           std::int64_t limit = 100'000) {
    std::vector<CovariateChange> changes;
    PageRequest page{limit, {}};
    do {
      const CovariatePage got = need(store_->covariates(key, range, page));
      changes.insert(changes.end(), got.items.begin(), got.items.end());
      page.cursor = got.next_cursor;
    } while (!page.cursor.empty());
    return changes;
  }

  static std::vector<std::int64_t> sequences(const std::vector<Sample>& samples) {
    std::vector<std::int64_t> numbers;
    for (const Sample& s : samples) numbers.push_back(s.sequence);
    return numbers;
  }

  TemporaryFolder folder_;
  std::int64_t now_utime_us_ = 1'000'000;
  std::unique_ptr<Store> store_;
};

bool same_bits(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) ||
         std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

// Accounts consist of doubles only: compared as an array, new members are included automatically.
using AccountNumbers = std::array<double, sizeof(signals::Accounts) / sizeof(double)>;

void expect_same_accounts(const signals::Accounts& a, const signals::Accounts& b) {
  const auto left = std::bit_cast<AccountNumbers>(a);
  const auto right = std::bit_cast<AccountNumbers>(b);
  for (std::size_t k = 0; k < left.size(); ++k) EXPECT_PRED2(same_bits, left[k], right[k]) << k;
}

void expect_same_mission(const Mission& a, const Mission& b) {
  EXPECT_EQ(a.key, b.key);
  EXPECT_EQ(a.robot_id, b.robot_id);
  EXPECT_EQ(a.mission_id, b.mission_id);
  EXPECT_EQ(a.start_utime_us, b.start_utime_us);
  EXPECT_EQ(a.end_utime_us, b.end_utime_us);
  EXPECT_EQ(a.state, b.state);
  EXPECT_EQ(a.implicit, b.implicit);
  EXPECT_EQ(a.incomplete, b.incomplete);
  EXPECT_EQ(a.incomplete_reason, b.incomplete_reason);
  EXPECT_PRED2(same_bits, a.payload_kg, b.payload_kg);
  EXPECT_EQ(a.note, b.note);
  EXPECT_EQ(a.model_version, b.model_version);
  EXPECT_EQ(a.samples, b.samples);
  EXPECT_EQ(a.sample_faults, b.sample_faults);
  EXPECT_EQ(a.gap_count, b.gap_count);
  EXPECT_PRED2(same_bits, a.gap_s, b.gap_s);
  EXPECT_EQ(a.findings_json, b.findings_json);
  expect_same_accounts(a.accounts, b.accounts);
  ASSERT_EQ(a.covariates.size(), b.covariates.size());
  for (std::size_t k = 0; k < a.covariates.size(); ++k) {
    const CovariateSummary &x = a.covariates[k], &y = b.covariates[k];
    EXPECT_EQ(x.name, y.name);
    EXPECT_PRED2(same_bits, x.mean, y.mean);
    EXPECT_PRED2(same_bits, x.min, y.min);
    EXPECT_PRED2(same_bits, x.max, y.max);
    EXPECT_PRED2(same_bits, x.known_s, y.known_s);
    EXPECT_EQ(x.counted_utime_us, y.counted_utime_us);
    EXPECT_PRED2(same_bits, x.value, y.value);
    EXPECT_EQ(x.value_utime_us, y.value_utime_us);
  }
}

// Changes of three names in turn, a hundredth of a second apart; every ninth is to an unknown value.
std::vector<CovariateChange> some_changes(std::int64_t first, std::size_t count) {
  const std::array<std::string, 3> names{"cpu_load", "surface=ice", "height_m"};
  std::vector<CovariateChange> changes;
  for (std::int64_t k = first; k < first + static_cast<std::int64_t>(count); ++k) {
    changes.push_back({10'000 * k, names[static_cast<std::size_t>(k) % 3],
                       k % 9 == 8 ? signals::unmeasured : 0.1 * static_cast<double>(k)});
  }
  return changes;
}

void expect_same_changes(const std::vector<CovariateChange>& a, const std::vector<CovariateChange>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    EXPECT_EQ(a[k].utime_us, b[k].utime_us) << k;
    EXPECT_EQ(a[k].name, b[k].name) << k;
    EXPECT_PRED2(same_bits, a[k].value, b[k].value) << k;
  }
}

// Every number differs from every other.
signals::Accounts distinct_accounts() {
  AccountNumbers numbers{};
  for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] = 0.1 + static_cast<double>(k);
  return std::bit_cast<signals::Accounts>(numbers);
}

// ---- models

TEST_P(StoreConformance, NumbersModelVersionsPerRobot) {
  EXPECT_EQ(apply(AddModel{"amr-1", 5, ModelOrigin::file, "first", R"({"a": 1})", {}}), 1);
  EXPECT_EQ(apply(AddModel{"amr-1", 6, ModelOrigin::calibration, "second", R"({"a": 2})", {}}), 2);
  EXPECT_EQ(apply(AddModel{"amr-2", 7, ModelOrigin::http, "", R"({"a": 3})", {}}), 1);

  const ModelVersion active = need(store_->model("amr-1"));
  EXPECT_EQ(active.version, 2);
  EXPECT_EQ(active.model_json, R"({"a": 2})");
  EXPECT_EQ(active.origin, ModelOrigin::calibration);
  EXPECT_EQ(active.note, "second");
  EXPECT_EQ(active.created_utime_us, 6);
  EXPECT_EQ(active.parent_version, 1);
  EXPECT_TRUE(active.active);

  const auto versions = need(store_->model_versions("amr-1"));
  ASSERT_EQ(versions.size(), 2U);
  EXPECT_EQ(versions[1].version, 1);
  EXPECT_FALSE(versions[1].active);
  EXPECT_EQ(versions[1].parent_version, std::nullopt);

  const auto robots = need(store_->robots());
  ASSERT_EQ(robots.size(), 2U);
  EXPECT_EQ(robots[0].robot_id, "amr-1");
  EXPECT_EQ(robots[0].active_version, 2);
}

TEST_P(StoreConformance, UnchangedModelAddsNoVersion) {
  EXPECT_EQ(apply(AddModel{"amr-1", 1, ModelOrigin::file, "", "{}", {}}), 1);
  EXPECT_EQ(apply(AddModel{"amr-1", 2, ModelOrigin::file, "", "{}", {}}), 1);
  EXPECT_EQ(need(store_->model_versions("amr-1")).size(), 1U);
}

TEST_P(StoreConformance, RollsBackAndBranchesVersions) {
  for (const char* text : {"[1]", "[2]", "[3]"})
    need(apply(AddModel{"amr-1", 1, ModelOrigin::file, "", text, {}}));
  EXPECT_EQ(apply(ActivateModel{"amr-1", 1}), 1);
  EXPECT_EQ(need(store_->model("amr-1")).model_json, "[1]");
  EXPECT_EQ(need(store_->model("amr-1", 3)).model_json, "[3]");
  EXPECT_EQ(apply(AddModel{"amr-1", 2, ModelOrigin::diagnosis, "", "[4]", {}}), 4);
  EXPECT_EQ(need(store_->model("amr-1")).parent_version, 1);
}

TEST_P(StoreConformance, RejectsModelsForOutdatedVersions) {
  EXPECT_EQ(apply(AddModel{"amr-1", 1, ModelOrigin::http, "", "[1]", 0}), 1);
  const Outcome stale = apply(AddModel{"amr-1", 2, ModelOrigin::http, "", "[2]", 0});
  ASSERT_FALSE(stale);
  EXPECT_EQ(stale.error().fault, Fault::conflict);
  EXPECT_EQ(apply(AddModel{"amr-1", 2, ModelOrigin::http, "", "[2]", 1}), 2);
}

TEST_P(StoreConformance, RefusedCommandLeavesNoTrace) {
  const std::vector<Command> commands = {
      AppendEvent{{0, 1, "", "before", "{}"}},
      AddModel{"ghost", 1, ModelOrigin::http, "", "not JSON", {}},
      ActivateModel{"amr-1", 7},
      AddModel{"", 1, ModelOrigin::http, "", "{}", {}},
      AppendEvent{{0, 2, "", "after", "{}"}},
  };
  const auto outcomes = need(store_->apply(commands));
  ASSERT_EQ(outcomes.size(), 5U);
  EXPECT_TRUE(outcomes[0]);
  EXPECT_EQ(outcomes[1].error().fault, Fault::invalid);
  EXPECT_EQ(outcomes[2].error().fault, Fault::not_found);
  EXPECT_EQ(outcomes[3].error().field, "robot_id");
  EXPECT_TRUE(outcomes[4]);
  EXPECT_TRUE(need(store_->robots()).empty());
  EXPECT_EQ(need(store_->events(0, 10)).size(), 2U);
}

TEST_P(StoreConformance, NamesAbsentRecords) {
  for (const Fault fault :
       {store_->model("absent").error().fault, store_->model_versions("absent").error().fault,
        store_->mission(7).error().fault, store_->trace(7, {}, 10).error().fault,
        store_->telemetry(7, {}, {}).error().fault, store_->covariates(7, {}, {}).error().fault})
    EXPECT_EQ(fault, Fault::not_found);
  Mission unknown;
  unknown.key = 7;
  unknown.robot_id = "amr-1";
  EXPECT_EQ(apply(CheckpointMission{unknown, {}, {}, {}}).error().fault, Fault::not_found);
}

// ---- diagnoses and proposals

DiagnosisRecord some_diagnosis(const std::string& robot_id, std::int64_t utime_us) {
  DiagnosisRecord d;
  d.robot_id = robot_id;
  d.created_utime_us = utime_us;
  d.cause = DiagnosisCause::watch;
  d.request_json = R"({"missions": 3})";
  d.model_version = 1;
  d.fitted_on = {4, 9};
  d.held_back = {7};
  return d;
}

TEST_P(StoreConformance, StoresDiagnosesUntilTheirReport) {
  need(apply(AddModel{"amr-1", 1, ModelOrigin::file, "", "{}", {}, R"({"why": 1})"}));
  EXPECT_EQ(need(store_->model("amr-1")).evidence_json, R"({"why": 1})");
  DiagnosisRecord d = some_diagnosis("amr-1", 5);
  d.id = need(apply(AddDiagnosis{d}));
  EXPECT_EQ(need(store_->diagnosis(d.id)).state, DiagnosisState::queued);
  EXPECT_EQ(store_->diagnosis_report(d.id).error().fault, Fault::not_found);
  d.state = DiagnosisState::done;
  d.started_utime_us = 6;
  d.finished_utime_us = 8;
  d.result_json = R"({"verdict": "none"})";
  d.summary_json = R"({"verdict":"none"})";
  d.model_json = R"({"effects": {}})";
  EXPECT_EQ(apply(UpdateDiagnosis{d, "<html>"}), d.id);
  reopen();
  const DiagnosisRecord read = need(store_->diagnosis(d.id));
  EXPECT_EQ(read.state, DiagnosisState::done);
  EXPECT_EQ(read.cause, DiagnosisCause::watch);
  EXPECT_EQ(read.request_json, d.request_json);
  EXPECT_EQ(read.fitted_on, d.fitted_on);
  EXPECT_EQ(read.held_back, d.held_back);
  EXPECT_EQ(read.result_json, d.result_json);
  EXPECT_EQ(read.summary_json, d.summary_json);
  const DiagnosisRecord listed = need(store_->diagnoses({}, 100, 10)).at(0);
  EXPECT_EQ(listed.summary_json, d.summary_json);
  EXPECT_EQ(listed.result_json, "");
  EXPECT_EQ(read.model_json, d.model_json);
  EXPECT_EQ(read.started_utime_us, 6);
  EXPECT_EQ(read.finished_utime_us, 8);
  EXPECT_EQ(need(store_->diagnosis_report(d.id)), "<html>");
  EXPECT_EQ(store_->diagnosis(99).error().fault, Fault::not_found);
  EXPECT_EQ(apply(UpdateDiagnosis{some_diagnosis("amr-1", 1), ""}).error().fault, Fault::not_found);
}

TEST_P(StoreConformance, ListsAndLimitsDiagnoses) {
  need(apply(AddModel{"amr-1", 1, ModelOrigin::file, "", "{}", {}}));
  need(apply(AddModel{"amr-2", 1, ModelOrigin::file, "", "{}", {}}));
  const std::int64_t other = need(apply(AddDiagnosis{some_diagnosis("amr-2", 1)}));
  std::int64_t first = 0, last = 0;
  for (std::int64_t k = 0; k < kept_diagnoses + 3; ++k) {
    DiagnosisRecord d = some_diagnosis("amr-1", 10 + k);
    d.id = last = need(apply(AddDiagnosis{d}));
    if (k == 0) first = last;
    d.state = k == 1 ? DiagnosisState::running : DiagnosisState::done;
    need(apply(UpdateDiagnosis{d, "<html>"}));
  }
  // One that runs is never dropped.
  EXPECT_EQ(store_->diagnosis(first).error().fault, Fault::not_found);
  EXPECT_TRUE(store_->diagnosis(first + 1));
  EXPECT_TRUE(store_->diagnosis(other));
  const auto newest = need(store_->diagnoses("amr-1", last + 1, 2));
  ASSERT_EQ(newest.size(), 2U);
  EXPECT_EQ(newest[0].id, last);
  EXPECT_EQ(need(store_->diagnoses("amr-1", last, 1)).at(0).id, last - 1);
  EXPECT_EQ(need(store_->diagnoses(std::nullopt, whole_future, max_page_size)).back().id, other);
}

TEST_P(StoreConformance, MarksAbandonedDiagnoses) {
  need(apply(AddModel{"amr-1", 1, ModelOrigin::file, "", "{}", {}}));
  std::vector<std::int64_t> ids;
  for (const auto state : {DiagnosisState::queued, DiagnosisState::running, DiagnosisState::done}) {
    DiagnosisRecord d = some_diagnosis("amr-1", 1);
    ids.push_back(d.id = need(apply(AddDiagnosis{d})));
    d.state = state;
    need(apply(UpdateDiagnosis{d, ""}));
  }
  EXPECT_EQ(apply(InterruptDiagnoses{77}), 2);
  EXPECT_EQ(need(store_->diagnosis(ids[0])).state, DiagnosisState::interrupted);
  EXPECT_EQ(need(store_->diagnosis(ids[1])).finished_utime_us, 77);
  EXPECT_EQ(need(store_->diagnosis(ids[2])).state, DiagnosisState::done);
}

TEST_P(StoreConformance, ProposalsAreClosedOnce) {
  need(apply(AddModel{"amr-1", 1, ModelOrigin::file, "", "{}", {}}));
  Proposal p;
  p.robot_id = "amr-1";
  p.created_utime_us = 3;
  p.kind = "calibration";
  p.note = "slow drift";
  p.base_version = 1;
  p.fitted_on = {1, 2};
  p.model_json = R"({"a": 1})";
  p.detail_json = R"({"b": 2})";
  const std::int64_t first = need(apply(AddProposal{p}));
  const std::int64_t second = need(apply(AddProposal{p}));
  EXPECT_EQ(need(store_->proposal(first)).state, ProposalState::superseded);
  const Proposal read = need(store_->proposal(second));
  EXPECT_EQ(read.state, ProposalState::open);
  EXPECT_EQ(read.note, p.note);
  EXPECT_EQ(read.base_version, 1);
  EXPECT_EQ(read.fitted_on, p.fitted_on);
  EXPECT_EQ(read.model_json, p.model_json);
  EXPECT_EQ(read.detail_json, p.detail_json);
  EXPECT_EQ(apply(CloseProposal{second, ProposalState::adopted, 1}), second);
  EXPECT_EQ(need(store_->proposal(second)).adopted_version, 1);
  EXPECT_EQ(apply(CloseProposal{second, ProposalState::dismissed, {}}).error().fault, Fault::conflict);
  EXPECT_EQ(apply(CloseProposal{99, ProposalState::dismissed, {}}).error().fault, Fault::not_found);
  EXPECT_EQ(need(store_->proposals("amr-1", whole_future, 10)).size(), 2U);
}

// ---- missions

TEST_P(StoreConformance, RestoresEveryNumber) {
  need(apply(AddModel{"amr-1", 1, ModelOrigin::file, "", "{}", {}}));
  Mission m = start_mission(*store_, "amr-1", "tour \"7\"\n", 123'456'789);
  m.end_utime_us = 223'456'789;
  m.state = MissionState::aborted;
  m.implicit = true;
  m.incomplete = true;
  m.incomplete_reason = "a gap of 12.5 s";
  m.payload_kg = 12.25;
  m.note = "größer";
  m.model_version = 1;
  m.samples = 1001;
  m.sample_faults = {{"late", 3}, {"duplicate", 1}};
  m.gap_count = 2;
  m.gap_s = 12.75;
  m.findings_json = R"({"payload":{"verdict":"as_declared"}})";
  m.accounts = distinct_accounts();
  m.covariates = {{"cpu_load", 0.1, 1e-300, 3.5, 12.25, 223'456'789, 0.3, 200'000'000},
                  {"surface=ice", signals::unmeasured, 0, 1, 0, 5, signals::unmeasured, 6}};
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_same_mission(need(store_->mission(m.key)), m);
  reopen();
  expect_same_mission(need(store_->mission(m.key)), m);
}

TEST_P(StoreConformance, DistinguishesUnmeasuredFromZero) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  m.accounts = distinct_accounts();
  m.accounts.measured_j = signals::unmeasured;
  m.accounts.measured_motor_j = {signals::unmeasured, 0.0};
  m.accounts.ledger[signals::Term::unexplained] = signals::unmeasured;
  m.payload_kg = signals::unmeasured;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  const Mission stored = need(store_->mission(m.key));
  expect_same_mission(stored, m);
  EXPECT_TRUE(std::isnan(stored.accounts.measured_j));
  EXPECT_EQ(stored.accounts.measured_motor_j[1], 0.0);
}

TEST_P(StoreConformance, KeysAreNeverReused) {
  const MissionKey key = need(store_->new_mission_key());
  EXPECT_GT(need(store_->new_mission_key()), key);
  const MissionKey stored = start_mission(*store_, "amr-1", "m", 5).key;
  reopen();
  EXPECT_GT(need(store_->new_mission_key()), stored);
}

TEST_P(StoreConformance, FindsEarlierMissionByName) {
  const auto earlier = [&](const std::string& robot, const std::string& id, std::int64_t start_us) {
    const Mission mission = new_mission(*store_, robot, id, start_us);
    return std::pair(mission.key, need(apply(StartMission{mission})));
  };
  const auto [first, none] = earlier("amr-1", "m", 5);
  EXPECT_EQ(none, 0);
  const auto [second, before_second] = earlier("amr-1", "m", 7);
  EXPECT_EQ(before_second, first);
  EXPECT_EQ(earlier("amr-1", "m", 6).second, first);
  EXPECT_EQ(earlier("amr-1", "m", 100).second, second);
  EXPECT_EQ(earlier("amr-2", "m", 100).second, 0);
  EXPECT_EQ(earlier("amr-1", "n", 100).second, 0);
  Mission implicit = new_mission(*store_, "amr-1", "m", 200);
  implicit.implicit = true;
  EXPECT_EQ(need(apply(StartMission{implicit})), 0);
}

TEST_P(StoreConformance, RejectsKeysOfOtherMissions) {
  const Mission m = start_mission(*store_, "amr-1", "m", 5);
  Mission other = m;
  other.mission_id = "n";
  EXPECT_EQ(apply(StartMission{other}).error().fault, Fault::conflict);
}

TEST_P(StoreConformance, RestartReplacesAllStoredData) {
  const Mission other = start_mission(*store_, "amr-1", "m", 1);
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  m.state = MissionState::finished;
  m.samples = 10;
  TraceBucket bucket;
  need(apply(CheckpointMission{m, {bucket}, some_samples(0, 0, 10), {}, some_changes(0, 7)}));
  EXPECT_EQ(all_samples(m.key).size(), 10U);
  EXPECT_EQ(all_changes(m.key).size(), 7U);

  const Mission again = start_mission(*store_, "amr-1", "m", 0);
  EXPECT_GT(again.key, m.key);
  EXPECT_EQ(store_->mission(m.key).error().fault, Fault::not_found);
  EXPECT_EQ(need(store_->mission(again.key)).samples, 0);
  EXPECT_TRUE(need(store_->trace(again.key, {}, 10)).buckets.empty());
  EXPECT_TRUE(all_samples(again.key).empty());
  EXPECT_TRUE(all_changes(again.key).empty());
  EXPECT_EQ(need(store_->mission(other.key)).start_utime_us, 1);

  // Within one transaction, too.
  const Mission third = new_mission(*store_, "amr-1", "m", 0);
  const std::vector<Command> commands{CheckpointMission{again, {bucket}, some_samples(0, 0, 10), {}},
                                      StartMission{third},
                                      CheckpointMission{third, {}, some_samples(0, 0, 3), {}}};
  for (const Outcome& outcome : need(store_->apply(commands))) EXPECT_TRUE(outcome);
  EXPECT_EQ(store_->mission(again.key).error().fault, Fault::not_found);
  EXPECT_EQ(all_samples(third.key).size(), 3U);
  EXPECT_FALSE(apply(CheckpointMission{again, {}, {}, {}}));
}

TEST_P(StoreConformance, RejectsMissingModelVersions) {
  Mission m = new_mission(*store_, "amr-1", "m", 0);
  m.model_version = 3;
  EXPECT_EQ(apply(StartMission{m}).error().fault, Fault::invalid);
}

TEST_P(StoreConformance, PagesNewestFirst) {
  const auto missions = add_missions("amr-1", 25);
  std::vector<MissionKey> expected;
  for (auto m = missions.rbegin(); m != missions.rend(); ++m) expected.push_back(m->key);
  for (const std::int64_t limit : {1, 7, 24, 25, 26}) EXPECT_EQ(walk({}, limit), expected) << limit;
}

TEST_P(StoreConformance, PagesMissionsWithEqualStart) {
  std::set<MissionKey> expected;
  for (int i = 0; i < 9; ++i)
    expected.insert(start_mission(*store_, "amr-" + std::to_string(i), "m", 77).key);
  const auto keys = walk({}, 2);
  EXPECT_EQ(keys.size(), 9U);
  EXPECT_EQ(std::set<MissionKey>(keys.begin(), keys.end()), expected);
}

TEST_P(StoreConformance, PagesStayStableUnderInserts) {
  const auto missions = add_missions("amr-1", 20);
  std::vector<MissionKey> seen;
  PageRequest page{3, {}};
  int inserted = 0;
  do {
    const MissionPage got = need(store_->missions({}, page));
    for (const Mission& m : got.missions) seen.push_back(m.key);
    page.cursor = got.next_cursor;
    // One newer than everything, at every page.
    start_mission(*store_, "amr-2", "late", (5000 + inserted++) * 1'000'000LL);
  } while (!page.cursor.empty());
  std::vector<MissionKey> expected;
  for (auto m = missions.rbegin(); m != missions.rend(); ++m) expected.push_back(m->key);
  EXPECT_EQ(seen, expected);
}

TEST_P(StoreConformance, FiltersMissions) {
  auto missions = add_missions("amr-1", 10);
  add_missions("amr-2", 3);
  missions[4].incomplete = true;
  missions[4].state = MissionState::interrupted;
  need(apply(CheckpointMission{missions[4], {}, {}, {}}));
  const MissionKey undeclared = start_mission(*store_, "amr-1", "undeclared", 0).key;

  MissionFilter f;
  f.robot_ids = {"amr-2"};
  EXPECT_EQ(walk(f, 2).size(), 3U);
  f.mission_id = "m1";
  EXPECT_EQ(walk(f, 2).size(), 1U);

  f = {};
  f.robot_ids = {"amr-1"};
  f.started.from_utime_us = missions[2].start_utime_us;
  f.started.to_utime_us = missions[5].start_utime_us;
  EXPECT_THAT(walk(f, 10), ::testing::ElementsAre(missions[4].key, missions[3].key, missions[2].key));

  f = {};
  f.states = {MissionState::interrupted, MissionState::open};
  EXPECT_THAT(walk(f, 10), ::testing::ElementsAre(missions[4].key, undeclared));

  f = {};
  f.incomplete = true;
  EXPECT_THAT(walk(f, 10), ::testing::ElementsAre(missions[4].key));

  f = {};
  f.robot_ids = {"amr-1"};
  f.payload_max_kg = 1.0;
  EXPECT_THAT(walk(f, 10), ::testing::ElementsAre(missions[1].key, missions[0].key));
  f.payload_min_kg = 0.5;
  EXPECT_THAT(walk(f, 10), ::testing::ElementsAre(missions[1].key));
}

TEST_P(StoreConformance, FindsPartsOfMissionNames) {
  const std::vector<std::string> names{"100%",        "a_b",   "axb",    "Tour!7",
                                       "back\\slash", "Größe", "GRÖSSE", "tour"};
  for (std::size_t k = 0; k < names.size(); ++k)
    start_mission(*store_, "amr-1", names[k], static_cast<std::int64_t>(k));
  const auto found = [&](const std::string& part) {
    MissionFilter f;
    f.name_contains = part;
    std::vector<std::string> all;
    for (const Mission& m :
         need(store_->missions(f, {.limit = 100, .cursor = {}}, {MissionOrder::start, true})).missions)
      all.push_back(m.mission_id);
    return all;
  };
  EXPECT_THAT(found("%"), ::testing::ElementsAre("100%"));
  EXPECT_THAT(found("_"), ::testing::ElementsAre("a_b"));
  EXPECT_THAT(found("A_B"), ::testing::ElementsAre("a_b"));
  EXPECT_THAT(found("!"), ::testing::ElementsAre("Tour!7"));
  EXPECT_THAT(found("\\"), ::testing::ElementsAre("back\\slash"));
  EXPECT_THAT(found("TOUR"), ::testing::ElementsAre("Tour!7", "tour"));
  EXPECT_THAT(found("gr"), ::testing::ElementsAre("Größe", "GRÖSSE"));
  // Only letters of ASCII are found in any case.
  EXPECT_THAT(found("grö"), ::testing::ElementsAre("Größe"));
  EXPECT_EQ(found("").size(), names.size());
  EXPECT_TRUE(found(std::string(10'000, 'x')).empty());
}

TEST_P(StoreConformance, FiltersByManyRobots) {
  const auto missions = add_missions("amr-7", 2);
  add_missions("amr-x", 1);
  MissionFilter f;
  for (std::size_t k = 0; k < max_filter_robots; ++k) f.robot_ids.push_back("amr-" + std::to_string(k));
  f.states = {MissionState::open, MissionState::finished, MissionState::open};
  EXPECT_THAT(walk(f, 1), ::testing::ElementsAre(missions[1].key, missions[0].key));
  EXPECT_EQ(need(store_->totals(f)).missions, 2);
  f.robot_ids.push_back("amr-x");
  EXPECT_EQ(store_->totals(f).error().field, "robot_id");
}

TEST_P(StoreConformance, SortsMissionsInStablePages) {
  auto missions = add_missions("amr-1", 9);
  // Ratios 1.5, 0.5, 1.5, 0.5 ..., none of the last two.
  for (std::size_t k = 0; k < missions.size(); ++k) {
    signals::Accounts& a = missions[k].accounts;
    a.battery_j = 100.0 - static_cast<double>(k);
    a.distance_m = static_cast<double>(k % 4) * 10;
    a.measured_s = k < 7 ? 1 : 0;
    a.measured_j = k % 2 == 0 ? 15 : 5;
    a.ledger[signals::Term::unexplained] = a.measured_j - 10;
    if (k == 5) missions[k].state = MissionState::aborted;
    need(apply(CheckpointMission{missions[k], {}, {}, {}}));
  }
  start_mission(*store_, "amr-0", "m5-late", 1);
  const auto sorted = [&](MissionSort sort, std::int64_t limit, const MissionFilter& filter = {}) {
    std::vector<std::string> names;
    PageRequest page{limit, {}};
    do {
      const MissionPage got = need(store_->missions(filter, page, sort));
      for (const Mission& m : got.missions) names.push_back(m.mission_id);
      page.cursor = got.next_cursor;
    } while (!page.cursor.empty());
    return names;
  };
  const std::vector<std::pair<MissionSort, std::vector<std::string>>> expected{
      {{MissionOrder::energy, true}, {"m5-late", "m8", "m7", "m6", "m5", "m4", "m3", "m2", "m1", "m0"}},
      {{MissionOrder::ratio, false}, {"m6", "m4", "m2", "m0", "m5", "m3", "m1", "m5-late", "m8", "m7"}},
      {{MissionOrder::ratio, true}, {"m1", "m3", "m5", "m0", "m2", "m4", "m6", "m7", "m8", "m5-late"}},
      {{MissionOrder::wh_per_km, false}, {"m1", "m5", "m2", "m6", "m3", "m7", "m5-late", "m8", "m4", "m0"}},
      {{MissionOrder::mission, true}, {"m0", "m1", "m2", "m3", "m4", "m5", "m5-late", "m6", "m7", "m8"}},
      {{MissionOrder::robot, true}, {"m5-late", "m0", "m1", "m2", "m3", "m4", "m5", "m6", "m7", "m8"}},
      {{MissionOrder::state, true}, {"m5-late", "m0", "m1", "m2", "m3", "m4", "m6", "m7", "m8", "m5"}},
      {{MissionOrder::start, true}, {"m5-late", "m0", "m1", "m2", "m3", "m4", "m5", "m6", "m7", "m8"}},
  };
  for (const auto& [sort, names] : expected)
    for (const std::int64_t limit : {1, 3, 9, 50})
      EXPECT_EQ(sorted(sort, limit), names) << static_cast<int>(sort.by) << " by " << limit;
  const std::string cursor = need(store_->missions({}, {2, {}}, {MissionOrder::ratio, false})).next_cursor;
  EXPECT_EQ(store_->missions({}, {2, cursor}, {MissionOrder::ratio, true}).error().field, "cursor");

  MissionFilter f;
  f.ratio_min = 0.4;
  f.ratio_max = 0.6;
  EXPECT_THAT(sorted({MissionOrder::start, true}, 2, f), ::testing::ElementsAre("m1", "m3", "m5"));
  f.ratio_max = 0.3;
  EXPECT_EQ(store_->missions(f, {}).error().field, "ratio_min");
  f = {};
  f.name_contains = "M5";
  EXPECT_THAT(sorted({MissionOrder::start, true}, 1, f), ::testing::ElementsAre("m5-late", "m5"));
  f.name_contains = "%";
  EXPECT_TRUE(sorted({}, 1, f).empty());
  f = {};
  f.robot_ids = {"amr-0", "amr-2", "not \"a\" robot"};
  EXPECT_THAT(sorted({}, 1, f), ::testing::ElementsAre("m5-late"));
}

TEST_P(StoreConformance, SumsRobotsDaysAndWeeks) {
  constexpr std::int64_t hour_us = 3'600'000'000, day_us = 24 * hour_us;
  const std::int64_t monday_us = 4 * day_us;  // 1970-01-05
  const auto add = [&](const std::string& robot, std::int64_t start_utime_us, double joule) {
    Mission m = start_mission(*store_, robot, "m" + std::to_string(start_utime_us), start_utime_us);
    m.accounts.battery_j = joule;
    need(apply(CheckpointMission{m, {}, {}, {}}));
  };
  add("amr-1", monday_us - hour_us, 1);
  add("amr-1", monday_us + hour_us, 2);
  add("amr-2", monday_us + 30 * hour_us, 4);
  const auto sums = [&](Grouping by, std::int64_t utc_offset_s, const MissionFilter& filter = {}) {
    std::vector<std::tuple<std::string, std::int64_t, double>> all;
    for (const TotalsGroup& g : need(store_->grouped_totals(filter, by, utc_offset_s)))
      all.emplace_back(g.robot_id, g.from_utime_us, g.totals.accounts.battery_j);
    return all;
  };
  using Row = std::tuple<std::string, std::int64_t, double>;
  EXPECT_THAT(sums(Grouping::robot, 0), ::testing::ElementsAre(Row{"amr-1", 0, 3}, Row{"amr-2", 0, 4}));
  EXPECT_THAT(sums(Grouping::day, 0),
              ::testing::ElementsAre(Row{"", monday_us - day_us, 1}, Row{"", monday_us, 2},
                                     Row{"", monday_us + day_us, 4}));
  EXPECT_THAT(sums(Grouping::week, 0),
              ::testing::ElementsAre(Row{"", monday_us - 7 * day_us, 1}, Row{"", monday_us, 6}));
  // Two hours ahead of UTC, the first mission is one of Monday.
  EXPECT_THAT(sums(Grouping::week, 7200), ::testing::ElementsAre(Row{"", monday_us - 2 * hour_us, 7}));
  EXPECT_THAT(sums(Grouping::day, -7200), ::testing::ElementsAre(Row{"", monday_us - 22 * hour_us, 3},
                                                                 Row{"", monday_us + 26 * hour_us, 4}));
  EXPECT_THAT(sums(Grouping::robot_day, -7200),
              ::testing::ElementsAre(Row{"amr-1", monday_us - 22 * hour_us, 3},
                                     Row{"amr-2", monday_us + 26 * hour_us, 4}));
  EXPECT_THAT(sums(Grouping::robot_day, 0),
              ::testing::ElementsAre(Row{"amr-1", monday_us - day_us, 1}, Row{"amr-1", monday_us, 2},
                                     Row{"amr-2", monday_us + day_us, 4}));
  EXPECT_THAT(sums(Grouping::robot_week, 0),
              ::testing::ElementsAre(Row{"amr-1", monday_us - 7 * day_us, 1}, Row{"amr-1", monday_us, 2},
                                     Row{"amr-2", monday_us, 4}));
  MissionFilter f;
  f.robot_ids = {"amr-2"};
  EXPECT_THAT(sums(Grouping::day, 0, f), ::testing::ElementsAre(Row{"", monday_us + day_us, 4}));
  f.robot_ids = {"absent"};
  EXPECT_TRUE(sums(Grouping::robot, 0, f).empty());
}

TEST_P(StoreConformance, RefusesBadQueries) {
  add_missions("amr-1", 3);
  MissionFilter f;
  const auto refuses = [&](const MissionFilter& filter, const PageRequest& page, const std::string& field) {
    const auto got = store_->missions(filter, page);
    ASSERT_FALSE(got) << field;
    EXPECT_EQ(got.error().fault, Fault::invalid);
    EXPECT_EQ(got.error().field, field);
  };
  refuses(f, {0, {}}, "limit");
  refuses(f, {max_page_size + 1, {}}, "limit");
  refuses(f, {1, "garbage"}, "cursor");
  const std::string cursor = need(store_->missions(f, {1, {}})).next_cursor;
  f.robot_ids = {"amr-1"};
  refuses(f, {1, cursor}, "cursor");
  f.started.from_utime_us = 2;
  f.started.to_utime_us = 1;
  refuses(f, {1, {}}, "from_utime_us");
  f = {};
  f.payload_min_kg = signals::unmeasured;
  refuses(f, {1, {}}, "payload_min_kg");
  EXPECT_EQ(store_->trace(1, {}, 0).error().field, "points");
  EXPECT_EQ(store_->telemetry(1, {5, 4}, {}).error().field, "from_utime_us");
  EXPECT_EQ(store_->covariates(1, {5, 4}, {}).error().field, "from_utime_us");
  EXPECT_EQ(store_->covariates(1, {}, {0, {}}).error().field, "limit");
  EXPECT_EQ(store_->events(0, 0).error().field, "limit");
}

TEST_P(StoreConformance, SumsOverMissions) {
  auto missions = add_missions("amr-1", 4);  // measured 0, 10, 20, 30 J
  missions[3].accounts.measured_j = signals::unmeasured;
  missions[3].accounts.measured_s = 0;
  missions[3].incomplete = true;
  missions[3].gap_count = 2;
  missions[3].gap_s = 1.5;
  missions[3].samples = 9;
  missions[3].accounts.ledger[signals::Term::drag] = 5;
  need(apply(CheckpointMission{missions[3], {}, {}, {}}));
  const Totals all = need(store_->totals({}));
  EXPECT_EQ(all.missions, 4);
  EXPECT_EQ(all.measured_missions, 3);
  EXPECT_EQ(all.incomplete_missions, 1);
  EXPECT_EQ(all.samples, 9);
  EXPECT_EQ(all.gap_count, 2);
  EXPECT_EQ(all.gap_s, 1.5);
  EXPECT_EQ(all.accounts.measured_j, 30);
  EXPECT_EQ(all.accounts.ledger[signals::Term::drag], 5);
  missions[1].findings_json = annulled_findings(missions[1], 17, "a \"test\"");
  need(apply(CheckpointMission{missions[1], {}, {}, {}}));
  EXPECT_EQ(need(store_->totals({})).missions, 3);
  EXPECT_EQ(need(store_->totals({})).accounts.measured_j, 20);
  EXPECT_EQ(need(store_->missions({}, {.limit = 10, .cursor = {}})).missions.size(), 4U);
  // Only a member of that name annuls, regardless of the rest of the findings.
  missions[0].findings_json = R"({"contradictions":["\"annulled\":1, annulled"]})";
  need(apply(CheckpointMission{missions[0], {}, {}, {}}));
  EXPECT_EQ(need(store_->totals({})).missions, 3);
  missions[0].findings_json =
      annulled_findings(missions[0], 17, std::string("nul \0 \\u0000 \"annulled\":", 24));
  need(apply(CheckpointMission{missions[0], {}, {}, {}}));
  EXPECT_EQ(need(store_->totals({})).missions, 2);
  EXPECT_EQ(need(store_->grouped_totals({}, Grouping::robot, 0)).front().totals.missions, 2);
  EXPECT_EQ(findings_of(need(store_->mission(missions[0].key))).annulled, findings_of(missions[0]).annulled);
  MissionFilter nobody;
  nobody.robot_ids = {"absent"};
  EXPECT_EQ(need(store_->totals(nobody)).missions, 0);
  EXPECT_TRUE(std::isnan(need(store_->totals(nobody)).accounts.measured_j));
}

TEST_P(StoreConformance, RecoversOpenMissions) {
  add_missions("amr-1", 2);
  Mission open = start_mission(*store_, "amr-2", "left open", 900);
  open.accounts = distinct_accounts();
  open.samples = 3;
  ResumeState state{"amr-2", 930, 17, 0.75, {41.5, signals::unmeasured}};
  open.covariates = {{"cpu_load", 0.5, 0.25, 0.75, 2, 930, 0.75, 920}};
  need(apply(CheckpointMission{open, {}, some_samples(900, 15, 3), state, some_changes(0, 5)}));
  reopen();

  const auto left = need(store_->recover());
  ASSERT_EQ(left.size(), 1U);
  expect_same_mission(left[0], open);
  const auto restored = need(store_->resume_state("amr-2"));
  ASSERT_TRUE(restored);
  EXPECT_EQ(restored->utime_us, 930);
  EXPECT_EQ(restored->sequence, 17);
  EXPECT_EQ(restored->state_of_charge, 0.75);
  EXPECT_EQ(restored->winding_temperature_c[0], 41.5);
  EXPECT_TRUE(std::isnan(restored->winding_temperature_c[1]));
  EXPECT_FALSE(need(store_->resume_state("amr-1")));

  // Resumed: it goes on where it was.
  need(apply(CheckpointMission{left[0], {}, some_samples(1000, 18, 2), {}, some_changes(5, 4)}));
  EXPECT_THAT(sequences(all_samples(open.key)), ::testing::ElementsAre(15, 16, 17, 18, 19));
  expect_same_changes(all_changes(open.key), some_changes(0, 9));
  open.state = MissionState::interrupted;
  need(apply(CheckpointMission{open, {}, {}, {}}));
  EXPECT_TRUE(need(store_->recover()).empty());
}

TEST_P(StoreConformance, KeepsTheLatestByTopic) {
  need(apply(PutLearned{{"amr-1", "charge", 5, R"({"a":1})"}}));
  need(apply(PutLearned{{"amr-1", "taper", 6, R"({"b":2})"}}));
  need(apply(PutLearned{{"amr-1", "charge", 7, R"({"a":3})"}}));
  const auto charge = need(store_->learned("amr-1", "charge"));
  ASSERT_TRUE(charge);
  EXPECT_EQ(charge->utime_us, 7);
  EXPECT_EQ(charge->body_json, R"({"a":3})");
  EXPECT_EQ(need(store_->learned("amr-1", "taper"))->body_json, R"({"b":2})");
  EXPECT_FALSE(need(store_->learned("amr-2", "charge")));
}

TEST_P(StoreConformance, ListsATopicOfAllRobots) {
  for (const char* robot : {"b", "a", "c"}) need(apply(PutLearned{{robot, "place", 5, R"({"map":"hall"})"}}));
  need(apply(PutLearned{{"a", "charge", 6, "{}"}}));
  need(apply(PutLearned{{"c", "place", 7, R"({"map":"yard"})"}}));
  const auto places = need(store_->all_learned("place"));
  ASSERT_EQ(places.size(), 3U);
  EXPECT_EQ(places[0].robot_id, "a");
  EXPECT_EQ(places[0].topic, "place");
  EXPECT_EQ(places[0].utime_us, 5);
  EXPECT_EQ(places[2].body_json, R"({"map":"yard"})");
  EXPECT_TRUE(need(store_->all_learned("none")).empty());
}

TEST_P(StoreConformance, RefusesUnexpectedLearned) {
  EXPECT_EQ(apply(PutLearned{{"amr-1", "orders", 5, "[1]"}, 0, 4}).error().fault, Fault::conflict);
  need(apply(PutLearned{{"amr-1", "orders", 5, "[1]"}, 0, 0}));
  EXPECT_EQ(apply(PutLearned{{"amr-1", "orders", 6, "[2]"}, 0, 0}).error().fault, Fault::conflict);
  need(apply(PutLearned{{"amr-1", "orders", 7, "[3]"}, 0, 5}));
  EXPECT_EQ(need(store_->learned("amr-1", "orders"))->body_json, "[3]");
}

TEST_P(StoreConformance, KeepsFloorPlansByLevel) {
  const std::string image("\x89PNG\r\n\x1a\n\0'\xff", 11);
  FloorPlan ground{"hall", "0", 5, 0.05, -3, 4.5, 0.1, {{1, 2}, {-3.5, 4}}, "image/png", image};
  FloorPlan upper{"hall", "1", 6, 0.1, 0, 0, 0, {}, "image/svg+xml", "<svg/>"};
  need(apply(PutFloorPlan{upper}));
  need(apply(PutFloorPlan{ground}));
  ground.utime_us = 7;
  need(apply(PutFloorPlan{ground}));
  const auto listed = need(store_->floor_plans());
  ASSERT_EQ(listed.size(), 2);
  EXPECT_EQ(listed[0].level, "0");
  EXPECT_EQ(listed[1].level, "1");
  EXPECT_EQ(listed[0].image, "");
  const FloorPlan stored = need(store_->floor_plan("hall", "0"));
  EXPECT_EQ(stored.image, image);
  EXPECT_EQ(stored.chargers, ground.chargers);
  EXPECT_EQ(std::tuple(stored.utime_us, stored.resolution_m, stored.origin_x_m, stored.origin_y_m,
                       stored.origin_yaw_rad, stored.media_type),
            std::tuple(7, 0.05, -3.0, 4.5, 0.1, "image/png"));
  upper.image.clear();
  need(apply(PutFloorPlan{upper}));
  EXPECT_EQ(apply(PutFloorPlan{upper}).error().fault, Fault::not_found);
  EXPECT_EQ(store_->floor_plan("hall", "1").error().fault, Fault::not_found);
  EXPECT_EQ(need(store_->floor_plans()).size(), 1);
}

TEST_P(StoreConformance, KeepsEnergyStateOutsideMissions) {
  need(apply(PutResumeState{{"amr-1", 5, 1, 0.9, {20, 21}}}));
  need(apply(PutResumeState{{"amr-1", 6, 2, signals::unmeasured, {20, 21}}}));
  const auto state = need(store_->resume_state("amr-1"));
  ASSERT_TRUE(state);
  EXPECT_EQ(state->utime_us, 6);
  EXPECT_TRUE(std::isnan(state->state_of_charge));
}

// ---- traces

TEST_P(StoreConformance, ReplacesBucketsAndReadsRanges) {
  const Mission m = start_mission(*store_, "amr-1", "m", 0);
  std::vector<TraceBucket> trace(10);
  for (std::size_t i = 0; i < trace.size(); ++i) {
    trace[i].start_utime_us = static_cast<std::int64_t>(i) * trace_bucket_us;
    trace[i].covered_s = 1;
    trace[i].speed_m_s = {0.5, 1, 1.5};
    trace[i].measured_j = static_cast<double>(i);
  }
  need(apply(CheckpointMission{m, trace, {}, {}}));
  trace[9].measured_power_w = {1, 2, 3};
  trace[9].modelled_power_w = {4, 5, 6};
  trace[9].state_of_charge = 0.25;
  trace[9].modelled_j = 8;
  trace[9].x_m = -1;
  trace[9].y_m = -2;
  need(apply(CheckpointMission{m, {trace[9]}, {}, {}}));

  const Trace all = need(store_->trace(m.key, {}, 100));
  EXPECT_EQ(all.width_us, trace_bucket_us);
  ASSERT_EQ(all.buckets.size(), 10U);
  const TraceBucket& last = all.buckets[9];
  EXPECT_EQ(last.measured_power_w.min, 1);
  EXPECT_EQ(last.measured_power_w.mean, 2);
  EXPECT_EQ(last.measured_power_w.max, 3);
  EXPECT_EQ(last.modelled_power_w.min, 4);
  EXPECT_EQ(last.modelled_power_w.mean, 5);
  EXPECT_EQ(last.modelled_power_w.max, 6);
  EXPECT_EQ(last.speed_m_s.min, 0.5);
  EXPECT_EQ(last.speed_m_s.mean, 1);
  EXPECT_EQ(last.speed_m_s.max, 1.5);
  EXPECT_EQ(last.state_of_charge, 0.25);
  EXPECT_EQ(last.measured_j, 9);
  EXPECT_EQ(last.modelled_j, 8);
  EXPECT_EQ(last.x_m, -1);
  EXPECT_EQ(last.y_m, -2);
  EXPECT_TRUE(std::isnan(all.buckets[0].measured_power_w.mean));

  const Trace some = need(store_->trace(m.key, {3 * trace_bucket_us, 5 * trace_bucket_us}, 100));
  ASSERT_EQ(some.buckets.size(), 2U);
  EXPECT_EQ(some.buckets[0].start_utime_us, 3 * trace_bucket_us);

  const Trace few = need(store_->trace(m.key, {}, 3));
  EXPECT_EQ(few.width_us, 4 * trace_bucket_us);
  ASSERT_EQ(few.buckets.size(), 3U);
  EXPECT_EQ(few.buckets[2].covered_s, 2);
}

// Sums of each square in a reading, by its column and row.
struct Floor {
  std::map<std::pair<int, int>, FloorSums> squares;
  std::vector<MissionKey> missions;
  FloorReading reading;
};

Floor floor_of(const Store& store, const MissionFilter& filter, double cell_m,
               std::int64_t max_points = max_floor_points) {
  Floor floor;
  floor.reading = need(store.floor_visits(filter, cell_m, max_points, [&](const FloorMission& mission) {
    floor.missions.push_back(mission.key);
    for (const FloorVisit& v : mission.visits) {
      floor.squares[{v.column, v.row}] += v;
    }
    return true;
  }));
  return floor;
}

// A finished mission that drives along x from `x_m` on, a metre a second, one second a bucket; or stands.
Mission drive_along(Store& store, const std::string& robot_id, const std::string& name, int start_s,
                    double x_m, int seconds, bool stands = false) {
  Mission m = start_mission(store, robot_id, name, start_s * 1'000'000LL);
  m.end_utime_us = m.start_utime_us + seconds * 1'000'000LL;
  m.state = MissionState::finished;
  std::vector<TraceBucket> trace;
  for (int k = 0; k < seconds; ++k) {
    TraceBucket bucket;
    bucket.start_utime_us = (start_s + k) * trace_bucket_us;
    bucket.covered_s = 1;
    const double speed_m_s = stands ? -0.01 : -1;
    bucket.speed_m_s = {speed_m_s, speed_m_s, speed_m_s};
    bucket.measured_power_w = {40, 50, 60};
    bucket.modelled_power_w = {30, 40, 50};
    bucket.x_m = stands ? x_m : x_m + k;
    bucket.y_m = -0.25;
    trace.push_back(bucket);
  }
  need(apply_one(store, CheckpointMission{m, trace, {}, {}}));
  return m;
}

TEST_P(StoreConformance, SumsTracesByFloorSquare) {
  const Mission first = drive_along(*store_, "amr-1", "a", 100, -2.5, 6);
  const Mission second = drive_along(*store_, "amr-2", "b", 200, -0.5, 2);
  const Floor floor = floor_of(*store_, {}, 2);
  EXPECT_THAT(floor.missions, ::testing::UnorderedElementsAre(first.key, second.key));
  EXPECT_EQ(floor.reading.missions, 2);
  EXPECT_EQ(floor.reading.missions_read, 2);
  EXPECT_EQ(floor.reading.points, 8);
  // x -2.5 | -1.5 -0.5 | 0.5 1.5 | 2.5, and -0.5 | 0.5
  ASSERT_EQ(floor.squares.size(), 4U);
  const auto seconds = [&](int column) { return floor.squares.at({column, -1}).covered_s; };
  EXPECT_EQ(seconds(-2), 1);
  EXPECT_EQ(seconds(-1), 3);
  EXPECT_EQ(seconds(0), 3);
  EXPECT_EQ(seconds(1), 1);
  const FloorSums& square = floor.squares.at({0, -1});
  EXPECT_EQ(square.distance_m, 3);
  EXPECT_EQ(square.energy_j, 150);
  EXPECT_EQ(square.driving_j, 150);
  EXPECT_EQ(square.measured_j, 150);
  EXPECT_EQ(square.modelled_j, 120);

  MissionFilter of_one;
  of_one.robot_ids = {"amr-2"};
  EXPECT_EQ(floor_of(*store_, of_one, 2).missions, std::vector{second.key});
  MissionFilter later;
  later.started.from_utime_us = 150'000'000;
  EXPECT_EQ(floor_of(*store_, later, 2).missions, std::vector{second.key});
}

TEST_P(StoreConformance, FloorEnergyIsOfDriving) {
  drive_along(*store_, "amr-1", "a", 100, 0.5, 7, true);
  const Floor floor = floor_of(*store_, {}, 2);
  const FloorSums& square = floor.squares.at({0, -1});
  EXPECT_EQ(square.covered_s, 7);
  EXPECT_EQ(square.distance_m, 0);
  EXPECT_EQ(square.energy_j, 350);
  EXPECT_EQ(square.driving_j, 0);
  EXPECT_EQ(square.measured_j, 0);
  EXPECT_EQ(square.modelled_j, 0);
}

TEST_P(StoreConformance, OmitsUnplacedAndContradictedMissions) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  m.end_utime_us = 5'000'000;
  std::vector<TraceBucket> trace(5);
  for (std::size_t k = 0; k < trace.size(); ++k) {
    trace[k].start_utime_us = static_cast<std::int64_t>(k) * trace_bucket_us;
    trace[k].covered_s = 1;
    trace[k].modelled_power_w = {20, 20, 20};
    trace[k].speed_m_s = {1, 1, 1};
    trace[k].x_m = trace[k].y_m = 0.5;
  }
  trace[1].x_m = signals::unmeasured;
  trace[2].x_m = 1e300;
  trace[3].measured_power_w = {30, 30, 30};
  trace[4].modelled_power_w = {};
  need(apply(CheckpointMission{m, trace, {}, {}}));
  const Floor floor = floor_of(*store_, {}, 1);
  ASSERT_EQ(floor.squares.size(), 1U);
  EXPECT_EQ(floor.squares.begin()->second.energy_j, 50) << "measured, or else modelled";
  EXPECT_EQ(floor.squares.begin()->second.measured_j, 30) << "where both are available";
  EXPECT_EQ(floor.squares.begin()->second.modelled_j, 20);
  for (const std::string& findings :
       {annulled_findings(m, 1, "spilt"), std::string(R"({"contradictions":["battery_current"]})")}) {
    m.findings_json = findings;
    need(apply(CheckpointMission{m, {}, {}, {}}));
    EXPECT_EQ(floor_of(*store_, {}, 1).reading.missions, 0) << findings;
  }
}

TEST_P(StoreConformance, SamplesLongFloorsEvenly) {
  constexpr int missions = 200;
  for (int k = 0; k < missions; ++k)
    drive_along(*store_, "amr-" + std::to_string(k % 4), "m" + std::to_string(k), 100 * k, 0.5, 10);
  const Floor all = floor_of(*store_, {}, 1);
  EXPECT_EQ(all.reading.points, 10 * missions);
  EXPECT_EQ(all.squares.at({3, -1}).covered_s, missions);
  const Floor share = floor_of(*store_, {}, 1, 600);
  EXPECT_EQ(share.reading.missions, missions);
  EXPECT_LE(share.reading.points, 600);
  EXPECT_GE(share.reading.missions_read, 35);
  std::map<std::string, int> robots;
  int early = 0;
  for (const MissionKey key : share.missions) {
    const Mission m = need(store_->mission(key));
    ++robots[m.robot_id];
    early += m.start_utime_us < 100 * missions / 2 * 1'000'000LL;
  }
  ASSERT_EQ(robots.size(), 4U) << "of robots that take turns none is missing";
  const auto read = static_cast<double>(share.reading.missions_read);
  for (const auto& [robot, count] : robots) EXPECT_NEAR(count, read / 4, 4) << robot;
  EXPECT_NEAR(early, read / 2, 4);
  int told = 0;
  need(store_->floor_visits({}, 1, max_floor_points, [&](const FloorMission&) { return ++told < 3; }));
  EXPECT_EQ(told, 3) << "the sink ends the reading";
  EXPECT_EQ(store_->floor_visits({}, 0.01, 1000, [](const FloorMission&) { return true; }).error().field,
            "cell_m");
}

TEST_P(StoreConformance, InvalidBucketRefusesTheCheckpoint) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  m.samples = 5;
  TraceBucket off;
  off.start_utime_us = 1;
  EXPECT_EQ(apply(CheckpointMission{m, {off}, some_samples(0, 0, 5), {}}).error().fault, Fault::invalid);
  EXPECT_EQ(need(store_->mission(m.key)).samples, 0);
  EXPECT_TRUE(all_samples(m.key).empty());
}

// ---- raw telemetry

TEST_P(StoreConformance, ReturnsSamplesInArrivalOrder) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  // Sizes around and far above a chunk, so that tails are merged at every boundary.
  std::vector<std::int64_t> expected;
  for (const std::size_t size : {1U, 10U, 1012U, 1U, 1023U, 1024U, 1U, 5000U, 3U}) {
    const auto first = static_cast<std::int64_t>(expected.size());
    need(apply(CheckpointMission{m, {}, some_samples(10'000 * first, first, size), {}}));
    for (std::size_t i = 0; i < size; ++i) expected.push_back(first + static_cast<std::int64_t>(i));
    ASSERT_EQ(sequences(all_samples(m.key)), expected) << size;
  }
  m.state = MissionState::finished;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  EXPECT_EQ(sequences(all_samples(m.key)), expected);
  EXPECT_EQ(sequences(all_samples(m.key, {}, 777)), expected);
  EXPECT_EQ(all_samples(m.key)[4321].battery_voltage_v, 24.0 + 0.001 * 4321);
}

TEST_P(StoreConformance, ReadsRangesWithLateSamples) {
  const Mission m = start_mission(*store_, "amr-1", "m", 0);
  need(apply(CheckpointMission{m, {}, some_samples(1'000'000, 100, 50), {}}));
  need(apply(CheckpointMission{m, {}, some_samples(0, 0, 50), {}}));
  EXPECT_THAT(sequences(all_samples(m.key, {1'000'000, 1'030'000})), ::testing::ElementsAre(100, 101, 102));
  EXPECT_THAT(sequences(all_samples(m.key, {480'000, 1'010'001}, 2)),
              ::testing::ElementsAre(100, 101, 48, 49));
  EXPECT_TRUE(all_samples(m.key, {5'000'000, 6'000'000}).empty());
  const std::string cursor = need(store_->telemetry(m.key, {}, {10, {}})).next_cursor;
  EXPECT_EQ(store_->telemetry(m.key, {0, 5}, {10, cursor}).error().field, "cursor");
}

TEST_P(StoreConformance, PrunesByAgeSinceStoring) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  now_utime_us_ = 100'000'000;
  need(apply(CheckpointMission{m, {}, some_samples(0, 0, 1024), {}}));
  now_utime_us_ = 200'000'000;
  need(apply(CheckpointMission{m, {TraceBucket{}}, some_samples(20'000'000, 1024, 1024), {}}));
  Prune prune{{150'000'000, {}}, 1000};
  EXPECT_EQ(apply(prune), 0);
  now_utime_us_ = 260'000'000;
  EXPECT_EQ(apply(prune), 1);
  EXPECT_EQ(all_samples(m.key).front().sequence, 1024);
  EXPECT_EQ(all_samples(m.key).size(), 1024U);
  now_utime_us_ = 1'000'000'000;
  EXPECT_EQ(apply(prune), 1);
  EXPECT_TRUE(all_samples(m.key).empty());
  EXPECT_EQ(need(store_->trace(m.key, {}, 10)).buckets.size(), 1U);
  // Counting continues after pruning: an old cursor never reads an entry twice.
  need(apply(CheckpointMission{m, {}, some_samples(40'000'000, 2048, 5), {}}));
  EXPECT_EQ(all_samples(m.key).size(), 5U);
}

TEST_P(StoreConformance, PrunesOldestBytesFirst) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  for (int i = 0; i < 10; ++i) {
    ++now_utime_us_;
    need(apply(CheckpointMission{m, {}, some_samples(0, 1024 * i, 1024), {}}));
  }
  const std::int64_t full = need(store_->size()).telemetry_bytes;
  ASSERT_GT(full, 0);
  const Prune prune{{{}, full / 2}, 3};
  EXPECT_EQ(apply(prune), 3);
  std::int64_t dropped = 3;
  while (need(store_->size()).telemetry_bytes > full / 2) {
    const std::int64_t more = need(apply(prune));
    ASSERT_GT(more, 0);
    dropped += more;
  }
  EXPECT_EQ(apply(prune), 0);
  const auto rest = all_samples(m.key);
  EXPECT_EQ(rest.size(), 1024U * static_cast<std::size_t>(10 - dropped));
  EXPECT_EQ(rest.front().sequence, 1024 * dropped);
  // No more than needed: with one chunk more the bound would not hold. Chunks differ by far less than a half.
  EXPECT_GT(need(store_->size()).telemetry_bytes, full / 2 - full / 7);
}

// ---- covariates

TEST_P(StoreConformance, ReturnsChangesInArrivalOrder) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  std::size_t stored = 0;
  for (const std::size_t size : {1U, 10U, 1012U, 1U, 1023U, 1024U, 1U, 3000U, 3U}) {
    need(apply(CheckpointMission{m, {}, {}, {}, some_changes(static_cast<std::int64_t>(stored), size)}));
    stored += size;
    expect_same_changes(all_changes(m.key), some_changes(0, stored));
  }
  m.state = MissionState::finished;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_same_changes(all_changes(m.key, {}, 777), some_changes(0, stored));
  reopen();
  expect_same_changes(all_changes(m.key), some_changes(0, stored));
  EXPECT_EQ(all_changes(m.key, {1'000'000, 1'030'000}).size(), 3U);
  EXPECT_TRUE(all_changes(m.key, {500'000'000, 600'000'000}).empty());
  const std::string cursor = need(store_->covariates(m.key, {}, {10, {}})).next_cursor;
  EXPECT_EQ(store_->covariates(m.key, {0, 5}, {10, cursor}).error().field, "cursor");
  EXPECT_EQ(store_->telemetry(m.key, {}, {10, cursor}).error().field, "cursor");
}

TEST_P(StoreConformance, InvalidNameRefusesTheCheckpoint) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  m.samples = 5;
  for (const std::string& name : {std::string(), std::string("a b"), std::string(48, 'a')}) {
    const Outcome refused =
        apply(CheckpointMission{m, {}, some_samples(0, 0, 5), {}, {{1, "good", 1}, {2, name, 1}}});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().field, "/covariates/1/name");
  }
  EXPECT_EQ(need(store_->mission(m.key)).samples, 0);
  EXPECT_TRUE(all_changes(m.key).empty());
}

TEST_P(StoreConformance, PrunesCovariatesWithTelemetry) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  now_utime_us_ = 100'000'000;
  need(apply(CheckpointMission{m, {}, some_samples(0, 0, 1024), {}, some_changes(0, 1024)}));
  now_utime_us_ = 200'000'000;
  need(apply(CheckpointMission{m, {}, some_samples(0, 1024, 1024), {}, some_changes(1024, 1030)}));
  const std::int64_t full = need(store_->size()).telemetry_bytes;
  now_utime_us_ = 260'000'000;
  EXPECT_EQ(apply(Prune{{150'000'000, {}}, 1000}), 2);
  EXPECT_EQ(all_samples(m.key).front().sequence, 1024);
  EXPECT_EQ(all_changes(m.key).front().utime_us, 10'240'000);
  EXPECT_LT(need(store_->size()).telemetry_bytes, full);
  EXPECT_EQ(apply(Prune{{{}, 0}, 1000}), 2);  // the tail stays
  EXPECT_EQ(all_changes(m.key).size(), 6U);
  m.state = MissionState::finished;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  EXPECT_EQ(apply(Prune{{{}, 0}, 1000}), 1);
  EXPECT_TRUE(all_changes(m.key).empty());
  EXPECT_EQ(need(store_->size()).telemetry_bytes, 0);
}

// ---- events

TEST_P(StoreConformance, KeepsEventsInOrder) {
  const Outcome first = apply(AppendEvent{{99, 10, "amr-1", "robot_seen", R"({"n": 1})"}});
  const Outcome second = apply(AppendEvent{{0, 5, "", "started", "{}"}});
  ASSERT_TRUE(first && second);
  // Numbered without a hole, from 1 on.
  EXPECT_EQ(*first, 1);
  EXPECT_EQ(*second, 2);
  const auto all = need(store_->events(0, 10));
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].id, *first);
  EXPECT_EQ(all[0].utime_us, 10);
  EXPECT_EQ(all[0].robot_id, "amr-1");
  EXPECT_EQ(all[0].kind, "robot_seen");
  EXPECT_EQ(all[0].detail_json, R"({"n": 1})");
  EXPECT_EQ(all[1].robot_id, "");
  EXPECT_EQ(need(store_->events(*first, 10)).size(), 1U);
  EXPECT_EQ(need(store_->events(0, 1)).size(), 1U);
  EXPECT_EQ(need(store_->events(0, 10, {.robot_ids = {"amr-1"}})).size(), 1U);
  reopen();
  EXPECT_EQ(apply(AppendEvent{{0, 6, "", "started", "{}"}}), 3);
  EXPECT_EQ(apply(AppendEvent{{0, 5, "", "bad", "{"}}).error().fault, Fault::invalid);
}

// Every page of both logs with every filter, compared with a loop over the whole log.
TEST_P(StoreConformance, FiltersLogsByKindAndTime) {
  const std::array<std::string, 3> robots{"amr-1", "amr-2", ""}, kinds{"charged", "gap_drift", "started"};
  for (int k = 0; k < 24; ++k) {
    const std::string &robot = robots.at(k % 3), &kind = kinds.at(k / 3 % 3);
    need(apply(AppendEvent{{0, 100 + k, robot, kind, "{}"}}));
    need(apply(AppendAudit{{0, 100 + k, "", "", "", kind, "{}", ""}}));
  }
  const std::vector<Event> events = need(store_->events(0, 1000));
  const std::vector<AuditEntry> requests = need(store_->audit(0, 1000, {}));
  ASSERT_EQ(events.size(), 24U);
  ASSERT_EQ(requests.size(), 24U);
  const auto ids_of = [](const auto& entries) {
    std::vector<std::int64_t> ids;
    for (const auto& entry : entries) ids.push_back(entry.id);
    return ids;
  };
  // The ids of `all` in the filter's order, behind `behind_id`, at most `limit`.
  const auto expected = [](const auto& all, const LogFilter& f, std::int64_t behind_id, std::size_t limit,
                           auto kind_of, auto robot_of) {
    const auto among = [](const std::vector<std::string>& names, const std::string& name) {
      return names.empty() || std::ranges::find(names, name) != names.end();
    };
    std::vector<std::int64_t> ids;
    for (const auto& e : all)
      if (among(f.kinds, kind_of(e)) && among(f.robot_ids, robot_of(e)) &&
          e.utime_us >= f.range.from_utime_us && e.utime_us < f.range.to_utime_us &&
          (f.newest_first ? e.id < behind_id : e.id > behind_id))
        ids.push_back(e.id);
    if (f.newest_first) std::ranges::reverse(ids);
    if (ids.size() > limit) ids.resize(limit);
    return ids;
  };
  using Names = std::vector<std::string>;
  std::size_t found = 0;
  for (const Names& some_kinds : {Names{}, Names{"charged"}, Names{"gap_drift", "started"}, Names{"absent"}})
    for (const Names& some_robots : {Names{}, Names{"amr-2"}, Names{"amr-1", "amr-2"}})
      for (const TimeRange range : {TimeRange{}, TimeRange{105, 117}, TimeRange{110, whole_future}})
        for (const bool newest_first : {false, true})
          for (const std::int64_t behind : {std::int64_t{0}, std::int64_t{12}, whole_future}) {
            const LogFilter f{some_robots, some_kinds, range, newest_first};
            const auto kind_of = [](const Event& e) { return e.kind; };
            const auto robot_of = [](const Event& e) { return e.robot_id; };
            const auto ids = ids_of(need(store_->events(behind, 5, f)));
            EXPECT_EQ(ids, expected(events, f, behind, 5, kind_of, robot_of));
            found += ids.size();
            const LogFilter g{{}, some_kinds, range, newest_first};
            EXPECT_EQ(ids_of(need(store_->audit(behind, 5, g))),
                      expected(
                          requests, g, behind, 5, [](const AuditEntry& e) { return e.action; },
                          [](const AuditEntry&) { return std::string(); }));
          }
  EXPECT_GT(found, 100U);
  EXPECT_EQ(store_->events(0, 10, {.range = {2, 1}}).error().field, "from_utime_us");
  EXPECT_EQ(store_->events(0, 10, {.kinds = Names(max_filter_robots + 1)}).error().field, "kind");
}

// ---- threads

TEST_P(StoreConformance, AuditIsAlwaysAChain) {
  EXPECT_EQ(need(verify_audit(GetParam().url(folder_))).entries, 0);
  const auto append = [&](const std::string& actor) {
    return apply(AppendAudit{{0, ++now_utime_us_, actor, "192.0.2.7", "r-1", "putRobot", R"({"a": 1})", ""}});
  };
  for (int k = 1; k <= 3; ++k) EXPECT_EQ(append("größer-" + std::to_string(k)), k);
  std::vector<AuditEntry> entries;
  const AuditState state = need(
      verify_audit(GetParam().url(folder_), {}, [&](const AuditEntry& entry) { entries.push_back(entry); }));
  EXPECT_EQ(state.entries, 3);
  ASSERT_EQ(entries.size(), 3U);
  EXPECT_EQ(entries[1].actor, "größer-2");
  EXPECT_EQ(entries[1].detail_json, R"({"a": 1})");
  EXPECT_EQ(entries[2].hash, state.head);
  const auto newest = need(store_->audit(std::numeric_limits<std::int64_t>::max(), 2));
  ASSERT_EQ(newest.size(), 2U);
  EXPECT_EQ(newest[0].hash, state.head);
  EXPECT_EQ(newest[1].id, 2);
  EXPECT_EQ(need(store_->audit(2, 10)).size(), 1U);
  EXPECT_EQ(store_->audit(2, 0).error().fault, Fault::invalid);
  // A refused entry is no link.
  EXPECT_EQ(apply(AppendAudit{{0, 1, "", "", "", "", "{}", ""}}).error().fault, Fault::invalid);
  reopen();
  EXPECT_EQ(append("dave"), 4);
  EXPECT_EQ(need(verify_audit(GetParam().url(folder_), state.head)).entries, 4);
  EXPECT_EQ(verify_audit(GetParam().url(folder_), std::string(64, '1')).error().fault, Fault::corrupt);
}

TEST_P(StoreConformance, ShortenedAuditStaysAChain) {
  constexpr std::int64_t day_us = std::int64_t{86'400} * 1'000'000;
  const std::string url = GetParam().url(folder_);
  std::vector<AuditEntry> entries;
  const auto verified = [&](std::string_view head = {}) {
    entries.clear();
    return verify_audit(url, head, [&](const AuditEntry& entry) { entries.push_back(entry); });
  };
  // Three a day at the days 100, 101 and 102.
  for (std::int64_t k = 0; k < 9; ++k)
    need(apply(AppendAudit{{0, (100 + k / 3) * day_us + k % 3, "carol", "", "r", "putRobot", "{}", ""}}));
  need(verified());
  const std::vector<AuditEntry> all = entries;
  now_utime_us_ = 112 * day_us + 1;
  EXPECT_EQ(apply(PruneAudit{10 * day_us, 0}).error().fault, Fault::invalid);
  EXPECT_EQ(apply(PruneAudit{12 * day_us, 100}), 0) << "day 100 is not whole behind the bound";
  EXPECT_EQ(need(verified()).entries, 9);
  EXPECT_EQ(apply(PruneAudit{10 * day_us, 4}), 4) << "of the six of days 100 and 101";
  const AuditState shorter = need(verified());
  EXPECT_EQ(shorter.removed, 4);
  EXPECT_EQ(shorter.entries, 6) << "five of nine, and the statement";
  EXPECT_EQ(entries.front().id, 5);
  EXPECT_EQ(entries.front().hash, all[4].hash);
  EXPECT_EQ(entries.back().action, "audit_shortened");
  EXPECT_EQ(entries.back().detail_json, R"({"entries":4,"last_id":4,"last_hash":")" + all[3].hash + "\"}");
  EXPECT_EQ(entries.back().hash, audit_hash(all[8].hash, entries.back()));
  EXPECT_EQ(apply(PruneAudit{10 * day_us, 100}), 2);
  EXPECT_EQ(need(verified()).removed, 6);
  EXPECT_EQ(entries.size(), 5U) << "three of nine, two statements";
  EXPECT_TRUE(verified(all[5].hash)) << "the last removed entry";
  EXPECT_TRUE(verified(all[6].hash));
  const auto gone = verified(all[4].hash);
  ASSERT_FALSE(gone);
  EXPECT_NE(gone.error().message.find("first 6, which the retention removed"), std::string::npos);
  reopen();
  EXPECT_EQ(need(store_->size()).audit_entries, 5);
  EXPECT_EQ(apply(AppendAudit{{0, now_utime_us_, "dave", "", "r", "putRobot", "{}", ""}}), 12);
  // All of them are old: the statement alone is left, and the numbers go on.
  now_utime_us_ = 400 * day_us;
  EXPECT_EQ(apply(PruneAudit{10 * day_us, 100}), 6);
  EXPECT_EQ(need(verified()).entries, 1);
  EXPECT_EQ(entries.front().id, 13);
  EXPECT_EQ(apply(PruneAudit{10 * day_us, 100}), 0);
}

TEST_P(StoreConformance, ReadersSeeWholeTransactions) {
  Mission m = start_mission(*store_, "amr-1", "m", 0);
  std::atomic<bool> done{false};
  std::atomic<int> torn{0};
  std::atomic<int> failed{0};
  std::atomic<int> reads{0};
  std::vector<std::thread> readers;
  for (int k = 0; k < 6; ++k)  // more than the store has connections
    readers.emplace_back([&] {
      do {
        const auto mission = store_->mission(m.key);
        const auto page = store_->telemetry(m.key, {}, {100'000, {}});
        if (!mission || !page) {
          ++failed;
          continue;
        }
        ++reads;
        // A checkpoint adds ten samples and their count in one transaction; the page is read after the count.
        if (page->items.size() % 10 != 0 || static_cast<std::int64_t>(page->items.size()) < mission->samples)
          ++torn;
      } while (!done);
    });
  for (int i = 0; i < 300; ++i) {
    m.samples += 10;
    need(apply(CheckpointMission{m, {}, some_samples(100'000 * i, 10 * i, 10), {}}));
  }
  done = true;
  for (auto& reader : readers) reader.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(failed, 0);
  EXPECT_GE(reads, 6);
}

TEST_P(StoreConformance, RemovedRobotKeepsItsHistory) {
  EXPECT_EQ(apply(RemoveRobot{"amr-1"}).error().fault, Fault::not_found);
  need(apply(AddModel{"amr-1", 5, ModelOrigin::http, "", R"({"a": 1})", {}}));
  const Mission ended = add_missions("amr-1", 1).front();
  const Mission open = start_mission(*store_, "amr-1", "open", 9'000'000'000);
  EXPECT_EQ(apply(RemoveRobot{"amr-1"}), 0);
  EXPECT_EQ(need(store_->robots()).front().active_version, std::nullopt);
  EXPECT_EQ(need(store_->mission(ended.key)).state, MissionState::finished);
  EXPECT_EQ(need(store_->mission(open.key)).state, MissionState::interrupted);
  EXPECT_TRUE(need(store_->recover()).empty());
  // It comes back with the next version.
  EXPECT_EQ(apply(AddModel{"amr-1", 6, ModelOrigin::http, "", R"({"a": 1})", {}}), 2);
  EXPECT_EQ(need(store_->model_versions("amr-1")).size(), 2u);
}

TEST_P(StoreConformance, PurgedRobotKeepsItsEvents) {
  for (const char* id : {"amr-1", "amr-2"}) {
    need(apply(AddModel{id, 5, ModelOrigin::http, "", R"({"a": 1})", {}}));
    need(apply(AddModel{id, 6, ModelOrigin::http, "", R"({"a": 2})", {}}));
    Mission m = start_mission(*store_, id, "m", 1'000'000);
    m.model_version = 2;
    need(apply(CheckpointMission{m, {}, some_samples(0, 0, 10), {}}));
    need(apply(PutLearned{{id, "topic", 1, "{}"}}));
    DiagnosisRecord diagnosis;
    diagnosis.robot_id = id;
    diagnosis.request_json = "{}";
    const std::int64_t number = need(apply(AddDiagnosis{diagnosis}));
    diagnosis.id = number;
    need(apply(UpdateDiagnosis{diagnosis, "<html>"}));
    need(apply(AppendEvent{{0, 7, id, "kind", "{}"}}));
  }
  EXPECT_EQ(apply(RemoveRobot{"amr-1", true}), 1);
  const auto robots = need(store_->robots());
  ASSERT_EQ(robots.size(), 1u);
  EXPECT_EQ(robots.front().robot_id, "amr-2");
  EXPECT_EQ(store_->model("amr-1").error().fault, Fault::not_found);
  EXPECT_EQ(need(store_->totals({})).missions, 1);
  EXPECT_EQ(need(store_->diagnoses(std::nullopt, whole_future, 10)).size(), 1u);
  EXPECT_EQ(need(store_->learned("amr-1", "topic")), std::nullopt);
  EXPECT_EQ(need(store_->events(0, 10, {.robot_ids = {"amr-1"}})).size(), 1u);
  EXPECT_EQ(need(store_->size()).missions, 1);
  EXPECT_EQ(apply(AddModel{"amr-1", 8, ModelOrigin::http, "", R"({"a": 3})", {}}), 1);
}

TEST_P(StoreConformance, DropsOldestMissionsFirst) {
  const std::vector<Mission> missions = add_missions("amr-1", 5);  // they end when they start
  const Mission open = start_mission(*store_, "amr-1", "open", 1'000'000);
  now_utime_us_ = missions[3].end_utime_us + 10;
  EXPECT_EQ(apply(PruneMissions{9, 0}).error().fault, Fault::invalid);
  EXPECT_EQ(apply(PruneMissions{9, 3}), 3);
  EXPECT_EQ(apply(PruneMissions{9, 3}), 1);
  EXPECT_EQ(apply(PruneMissions{9, 3}), 0);
  EXPECT_EQ(walk({}, 10), (std::vector<MissionKey>{missions[4].key, open.key}));
}

TEST_P(StoreConformance, DropsOldestEventsFirst) {
  for (int k = 1; k <= 7; ++k) need(apply(AppendEvent{{0, k, k % 2 == 0 ? "amr-1" : "", "kind", "{}"}}));
  const auto times = [&] {
    std::vector<std::int64_t> all;
    for (const Event& event : need(store_->events(0, 100, {}))) all.push_back(event.utime_us);
    return all;
  };
  EXPECT_EQ(apply(PruneEvents{3, 0}).error().fault, Fault::invalid);
  EXPECT_EQ(apply(PruneEvents{0, 1}).error().fault, Fault::invalid);
  EXPECT_EQ(apply(PruneEvents{7, 10}), 0);
  EXPECT_EQ(apply(PruneEvents{3, 2}), 2);
  EXPECT_EQ(times(), (std::vector<std::int64_t>{3, 4, 5, 6, 7}));
  EXPECT_EQ(apply(PruneEvents{3, 10}), 2);
  EXPECT_EQ(times(), (std::vector<std::int64_t>{5, 6, 7}));
  // Numbering continues: a reader that has seen event 7 loses nothing.
  EXPECT_EQ(apply(PruneEvents{1, 10}), 2);
  const std::int64_t last = need(store_->events(0, 100, {})).front().id;
  EXPECT_EQ(need(apply(AppendEvent{{0, 8, "", "kind", "{}"}})), last + 1);
}

TEST_P(StoreConformance, KeepsAnswersForAWeek) {
  const RequestAnswer first{"ops", "key-1", "f1", 1'000, 202, "/v1/diagnoses/1", R"({"id": 1})"};
  RequestAnswer nobody = first;
  nobody.actor = "";
  nobody.body = "{}";
  need(apply(KeepAnswer{first}));
  need(apply(KeepAnswer{nobody}));
  EXPECT_EQ(need(store_->answer("ops", "key-1")), first);
  EXPECT_EQ(need(store_->answer("", "key-1")), nobody);
  EXPECT_EQ(need(store_->answer("ops", "key-2")), std::nullopt);
  EXPECT_EQ(apply(KeepAnswer{{"ops", "", "f", 0, 200, "", ""}}).error().fault, Fault::invalid);
  RequestAnswer later = first;
  later.key = "key-2";
  later.utime_us = first.utime_us + kept_answer_us;
  need(apply(KeepAnswer{later}));
  EXPECT_EQ(need(store_->answer("ops", "key-1")), first);
  ++later.utime_us;
  need(apply(KeepAnswer{later}));
  EXPECT_EQ(need(store_->answer("ops", "key-1")), std::nullopt);
  EXPECT_EQ(need(store_->answer("ops", "key-2")), later);
}

// A change of one event, under a key, with the command that follows from its id.
CommitChange keyed_change(const std::string& key, std::vector<Command> follow,
                          std::int64_t* calls = nullptr) {
  auto change = std::make_shared<Change>();
  change->key = RequestAnswer{"ops", key, "print", 1'000, 0, "", ""};
  change->command = AppendEvent{{0, 1'000, "amr", "changed", "{}"}};
  change->follow = [key, follow = std::move(follow), calls](std::int64_t outcome) {
    if (calls != nullptr) ++*calls;
    std::vector<Command> all = follow;
    all.emplace_back(KeepAnswer{{"ops", key, "print", 1'000, 200, "", std::to_string(outcome)}});
    return all;
  };
  return {change};
}

TEST_P(StoreConformance, KeepsChangesWithTheirAnswers) {
  AuditEntry entry;
  entry.action = "changeThing";
  const std::int64_t id = need(apply(keyed_change("k1", {AppendAudit{entry}})));
  EXPECT_EQ(need(store_->events(0, 10)).size(), 1U);
  EXPECT_EQ(need(store_->audit(whole_future, 10)).size(), 1U);
  const auto answer = need(store_->answer("ops", "k1"));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->body, std::to_string(id));
  EXPECT_EQ(answer->status, 200);
}

TEST_P(StoreConformance, RejectsAUsedKey) {
  need(apply(keyed_change("k1", {})));
  std::int64_t calls = 0;
  const Outcome again = apply(keyed_change("k1", {}, &calls));
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().fault, Fault::conflict);
  EXPECT_EQ(again.error().field, Change::key_field);
  EXPECT_EQ(calls, 0);
  EXPECT_EQ(need(store_->events(0, 10)).size(), 1U);
}

TEST_P(StoreConformance, RollsBackAWholeChange) {
  const std::vector<Command> batch{AppendEvent{{0, 1, "", "before", "{}"}},
                                   keyed_change("k1", {ActivateModel{"absent", 1}}),
                                   AppendEvent{{0, 2, "", "behind", "{}"}}};
  const auto outcomes = need(store_->apply(batch));
  EXPECT_TRUE(outcomes[0]);
  EXPECT_EQ(outcomes[1].error().fault, Fault::not_found);
  EXPECT_TRUE(outcomes[2]);
  std::vector<std::string> kinds;
  for (const Event& event : need(store_->events(0, 10))) kinds.push_back(event.kind);
  EXPECT_THAT(kinds, ::testing::ElementsAre("before", "behind"));
  EXPECT_EQ(need(store_->answer("ops", "k1")), std::nullopt);
  need(apply(keyed_change("k1", {})));
}

class SpoolConformance : public StoreConformance {
 protected:
  // Two events, spooled after the mark.
  void spool(const BatchMark& mark, std::int64_t attempted = 0) {
    const Command first = AppendEvent{{0, 1, "", "first", "{}"}},
                  second = AppendEvent{{0, 2, "", "second", "{}"}};
    const std::vector<const Command*> commands{&first, &second};
    const Result<void> written = write_spool(path(), TakeSpool{{}, mark, attempted}, commands);
    ASSERT_TRUE(written) << describe(written.error());
  }
  std::string path() const { return folder_.file("test.spool"); }
  Result<TakenSpool> take_in() {
    return take_in_spool(path(), *store_, [](const Error& error) { ADD_FAILURE() << describe(error); });
  }
  std::size_t events() { return need(store_->events(0, 100)).size(); }
  void change() { need(apply(AppendEvent{{0, 3, "", "changed", "{}"}})); }
};

TEST_P(SpoolConformance, TakesASpoolInOnce) {
  change();
  spool(store_->mark());
  const std::string copy = path() + ".copy";
  std::filesystem::copy_file(path(), copy);
  reopen();
  EXPECT_EQ(need(take_in()).commands, 2U);
  EXPECT_EQ(events(), 3U);
  EXPECT_FALSE(std::filesystem::exists(path()));
  // The file is still there where the program dies before it removes it.
  std::filesystem::rename(copy, path());
  reopen();
  const TakenSpool again = need(take_in());
  EXPECT_TRUE(again.before);
  EXPECT_EQ(events(), 3U);
  EXPECT_FALSE(std::filesystem::exists(path()));
}

TEST_P(SpoolConformance, AppliesToALaterCopy) {
  change();
  BatchMark later = store_->mark();
  later.batch += 3;
  spool(later);
  reopen();
  EXPECT_EQ(need(take_in()).commands, 2U);
  EXPECT_EQ(events(), 3U);
}

TEST_P(SpoolConformance, RejectsSpoolsOfEarlierStates) {
  change();
  spool(store_->mark());
  reopen();
  change();
  const auto late = take_in();
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().fault, Fault::conflict);
  EXPECT_EQ(events(), 2U);
  EXPECT_FALSE(std::filesystem::exists(path()));
  EXPECT_TRUE(std::filesystem::exists(path() + ".refused-1"));
  // A second one is kept under a name of its own.
  spool({"", "", 0});
  EXPECT_FALSE(take_in());
  EXPECT_TRUE(std::filesystem::exists(path() + ".refused-1"));
  EXPECT_TRUE(std::filesystem::exists(path() + ".refused-2"));
}

TEST_P(SpoolConformance, RejectsSpoolsOfOtherStores) {
  change();
  BatchMark other = store_->mark();
  other.store += "x";
  spool(other);
  EXPECT_EQ(take_in().error().fault, Fault::conflict);
  EXPECT_EQ(events(), 1U);
}

TEST_P(SpoolConformance, SkipsAlreadyCommittedCommands) {
  const BatchMark before = store_->mark();
  change();
  spool({before.store, store_->mark().writer, 0}, 1);
  reopen();
  EXPECT_EQ(need(take_in()).already, 1U);
  EXPECT_EQ(events(), 2U);
}

TEST_P(SpoolConformance, KeepsAnExistingSpool) {
  spool(store_->mark());
  const std::string before = text_of(path());
  const Command other = AppendEvent{{0, 9, "", "other", "{}"}};
  const std::vector<const Command*> commands{&other};
  const Result<void> written = write_spool(path(), TakeSpool{{}, store_->mark()}, commands);
  ASSERT_FALSE(written);
  EXPECT_EQ(text_of(path()), before);
  EXPECT_EQ(need(read_spool(path() + ".unfinished.refused-1")).size(), 2U);
}

TEST_P(SpoolConformance, KeepsUnreadableSpools) {
  std::filesystem::create_directory(path());  // opens, but cannot be read
  const auto taken = take_in();
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().fault, Fault::unavailable);
  EXPECT_TRUE(std::filesystem::exists(path()));
}

// The sums of days equal the sums over the missions after every kind of change.
TEST_P(StoreConformance, DaySumsFollowEveryChange) {
  constexpr std::int64_t second_us = 1'000'000, day_us = 86'400 * second_us;
  now_utime_us_ = 20'650 * day_us + 5 * 3600 * second_us;
  const auto expect_sums = [&](std::int64_t missions, double measured_j) {
    const Totals totals = need(store_->totals({}));
    EXPECT_EQ(totals.missions, missions);
    if (missions > 0) {
      EXPECT_EQ(totals.accounts.measured_j, measured_j);
    }
    std::int64_t grouped = 0;
    for (const TotalsGroup& group : need(store_->grouped_totals({}, Grouping::day, 0)))
      grouped += group.totals.missions;
    EXPECT_EQ(grouped, missions);
    // Of half a day: parts of days are summed up from missions.
    MissionFilter half;
    half.started.from_utime_us = now_utime_us_ - second_us;
    half.started.to_utime_us = now_utime_us_ + second_us;
    EXPECT_EQ(need(store_->totals(half)).missions, std::min<std::int64_t>(missions, 1));
  };
  Mission m = start_mission(*store_, "amr-1", "m", now_utime_us_);
  m.accounts.measured_j = 7;
  m.accounts.measured_s = 1;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 7);
  m.state = MissionState::finished;
  m.accounts.measured_j = 11;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 11);
  m.accounts.measured_j = 12;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 12);
  m.state = MissionState::open;  // taken up again
  m.accounts.measured_j = 13;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 13);
  need(apply(RemoveRobot{"amr-1", false}));  // interrupts it
  expect_sums(1, 13);
  Mission other = start_mission(*store_, "amr-1", "other", now_utime_us_ + 2 * day_us);
  other.state = MissionState::finished;
  need(apply(CheckpointMission{other, {}, {}, {}}));
  EXPECT_EQ(need(store_->totals({})).missions, 2);
  need(apply(StartMission{other}));  // restarted
  EXPECT_EQ(need(store_->totals({})).missions, 2);
  need(apply(RemoveRobot{"amr-1", true}));
  expect_sums(0, 0);
}

INSTANTIATE_TEST_SUITE_P(Stores, SpoolConformance, ::testing::Values(store_kind()),
                         [](const auto& kind) { return kind.param.name; });
INSTANTIATE_TEST_SUITE_P(Stores, StoreConformance, ::testing::Values(store_kind()),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace joulecast::history
