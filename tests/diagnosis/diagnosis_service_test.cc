#include "server/diagnosis/diagnosis_service.h"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "server/diagnosis/gap_watch.h"
#include "server/diagnosis/model_adoption.h"
#include "tests/diagnosis/history_of.h"

namespace joulecast::server {
namespace {

using history::DiagnosisState;
using nlohmann::json;
using testing::drive;
using testing::nomad_with_friction;
using testing::tested_on;

constexpr std::int64_t start_us = 1'750'000'000'000'000;

class DiagnosisServiceTest : public ::testing::Test {
 protected:
  void SetUp() override { harness_.add_version(testing::nomad(), 1); }

  void serve(DiagnosisOptions options = {}) {
    writer_ = std::make_unique<history::Writer>(*harness_.store, history::WriterOptions{});
    service_ = std::make_unique<DiagnosisService>(parts(drift_, 42), options,
                                                  [this](const history::DiagnosisRecord& d) {
                                                    if (watch_) watch_->on_diagnosis(d);
                                                  });
  }

  Parts parts(const DriftView& drift, std::int64_t now_utime_us) {
    return {*harness_.store,
            *writer_,
            harness_.models,
            drift,
            [now_utime_us] { return now_utime_us; },
            [this](const Error& error) { errors_.push_back(describe(error)); }};
  }

  history::DiagnosisRecord wait_for(std::int64_t id) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(3600);  // sanitized
    while (std::chrono::steady_clock::now() < until) {
      const auto stored = harness_.store->diagnosis(id);
      if (stored && history::has_ended(stored->state) && !service_->progress(id)) return *stored;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ADD_FAILURE() << "diagnosis " << id << " did not end";
    return {};
  }

  DiagnosisRequest request() const {
    DiagnosisRequest r;
    r.robot_id = "nomad";
    return r;
  }

  testing::PipelineHarness harness_;
  DriftView drift_{*harness_.store, harness_.models, {}};
  ingest::Forecasts forecasts_{*harness_.store};
  std::vector<std::string> errors_;
  std::unique_ptr<history::Writer> writer_;
  std::unique_ptr<GapWatch> watch_;
  std::unique_ptr<DiagnosisService> service_;
};

TEST_F(DiagnosisServiceTest, FindsAdoptableEffect) {
  const std::string_view file = virtual_robot::shipped_robots()[1].json_text;
  const auto robot = *robot::parse_robot(file);
  harness_.add_version(robot, 1);
  testing::play(harness_, file, {{"coulomb_friction", 0.6}}, 8, 21, start_us);
  std::vector<history::MissionKey> keys;
  for (const history::Mission& mission : harness_.missions()) keys.push_back(mission.key);
  ASSERT_EQ(keys.size(), 8U);
  serve();
  ASSERT_TRUE(service_->start());
  DiagnosisRequest wanted;
  wanted.robot_id = robot.robot_id;
  const auto id = service_->submit(wanted);
  ASSERT_TRUE(id) << describe(id.error());
  const auto d = wait_for(*id);
  ASSERT_EQ(d.state, DiagnosisState::done) << d.error;
  EXPECT_EQ(d.fitted_on.size(), 6U);
  EXPECT_EQ(d.held_back, (std::vector<history::MissionKey>{keys[3], keys[7]}));
  EXPECT_EQ(d.model_version, 1);
  const json result = json::parse(d.result_json);
  EXPECT_EQ(result["verdict"], "effects") << d.result_json;
  EXPECT_EQ(result["effects"][0]["id"], "coulomb_friction") << d.result_json;
  EXPECT_EQ(result["model_version"], 1);
  const json summary = json::parse(d.summary_json);
  EXPECT_EQ(summary["verdict"], result["verdict"]);
  EXPECT_EQ(summary["gap"], result["gap"]);
  EXPECT_EQ(summary["shrinkage"], result["shrinkage"]);
  EXPECT_EQ(summary["effects"][0]["probability"], result["effects"][0]["probability"]);
  EXPECT_EQ(summary["effects"].size(), result["effects"].size());

  ModelAdoption adoption(parts(drift_, 43), {});
  AdoptionRequest adopt;
  adopt.model = *robot::parse_robot(d.model_json);
  adopt.fitted_on = d.fitted_on;
  const auto adopted = adoption.adopt(adopt);
  ASSERT_TRUE(adopted) << describe(adopted.error());
  EXPECT_TRUE(adopted->adopted) << adopted->refusal;
  EXPECT_EQ(tested_on(*adopted), d.held_back);
  EXPECT_LT(adopted->test.error_after, 0.2 * adopted->test.error_before);
  EXPECT_EQ(service_->counts().done, 1U);
  EXPECT_TRUE(errors_.empty());
}

TEST_F(DiagnosisServiceTest, BoundsAndCancelsQueue) {
  drive(harness_, testing::nomad(), 0);
  DiagnosisOptions options;
  options.queue = 2;
  serve(options);  // not started: jobs only wait
  const auto first = service_->submit(request()), second = service_->submit(request());
  ASSERT_TRUE(first && second);
  EXPECT_EQ(service_->submit(request()).error().fault, Fault::unavailable);
  EXPECT_EQ(service_->progress(*second)->ahead, 1U);
  EXPECT_TRUE(service_->cancel(*first));
  EXPECT_EQ(harness_.store->diagnosis(*first)->state, DiagnosisState::cancelled);
  EXPECT_EQ(service_->progress(*second)->ahead, 0U);
  EXPECT_EQ(service_->cancel(*first).error().fault, Fault::conflict);
  EXPECT_EQ(service_->cancel(99).error().fault, Fault::not_found);
  EXPECT_TRUE(service_->submit(request()));
}

TEST_F(DiagnosisServiceTest, MarksInterruptedJobsOnStart) {
  drive(harness_, testing::nomad(), 0);
  serve();
  const auto id = service_->submit(request());
  ASSERT_TRUE(id);
  service_.reset();
  EXPECT_EQ(harness_.store->diagnosis(*id)->state, DiagnosisState::queued);
  serve();
  ASSERT_TRUE(service_->start());
  const auto d = harness_.store->diagnosis(*id);
  EXPECT_EQ(d->state, DiagnosisState::interrupted);
  EXPECT_FALSE(d->error.empty());
}

TEST_F(DiagnosisServiceTest, RunsJobsOfOtherDaemons) {
  drive(harness_, testing::nomad(), 0);
  serve();  // not started, as in a daemon that stops before the job begins
  DiagnosisRequest wanted = request();
  wanted.missions = {harness_.missions().front().key};
  wanted.hold_back = 0;
  const auto id = service_->submit(wanted);
  ASSERT_TRUE(id) << describe(id.error());
  serve();
  EXPECT_EQ(service_->take_over(*id + 1).error().fault, Fault::not_found);
  ASSERT_TRUE(service_->start());  // outside a cluster this interrupts the remaining jobs
  ASSERT_TRUE(service_->take_over(*id));
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(600);
  while (service_->counts().done + service_->counts().failed == 0 && std::chrono::steady_clock::now() < until)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  const auto d = harness_.store->diagnosis(*id);
  ASSERT_TRUE(d);
  EXPECT_TRUE(d->state == DiagnosisState::done || d->state == DiagnosisState::failed);
  EXPECT_EQ(d->fitted_on, wanted.missions);
  EXPECT_TRUE(d->held_back.empty());
}

TEST_F(DiagnosisServiceTest, RejectsImpossibleJobs) {
  serve();
  const auto bare = service_->submit(request());
  EXPECT_EQ(bare.error().fault, Fault::conflict);
  EXPECT_EQ(bare.error().field, "/robot_id");
  EXPECT_NE(bare.error().message.find("no mission that has ended"), std::string::npos)
      << bare.error().message;
  drive(harness_, testing::nomad(), 0);
  DiagnosisRequest late = request();
  late.since_utime_us = std::int64_t{1} << 52;
  EXPECT_EQ(service_->submit(late).error().field, "/since_utime_us");
  DiagnosisRequest unknown = request();
  unknown.robot_id = "absent";
  EXPECT_EQ(service_->submit(unknown).error().field, "/robot_id");
  unknown = request();
  unknown.missions = {77};
  EXPECT_EQ(service_->submit(unknown).error().field, "/missions/0");
  EXPECT_TRUE(harness_.store->diagnoses({}, 100, 10)->empty());
}

TEST_F(DiagnosisServiceTest, ReportsCauseOfFailure) {
  drive(harness_, testing::nomad(), 0);
  history::Command prune = history::Prune{{.telemetry_max_age_us = {}, .telemetry_max_bytes = 0}, 1000};
  ASSERT_TRUE(harness_.store->apply({&prune, 1}));
  serve();
  ASSERT_TRUE(service_->start());
  const auto id = service_->submit(request());
  ASSERT_TRUE(id) << describe(id.error());
  const auto d = wait_for(*id);
  EXPECT_EQ(d.state, DiagnosisState::failed);
  EXPECT_NE(d.error.find("none of the robot's missions"), std::string::npos) << d.error;
}

TEST_F(DiagnosisServiceTest, ReportsStartOfJobs) {
  const std::string_view file = virtual_robot::shipped_robots()[1].json_text;
  const auto robot = *robot::parse_robot(file);
  harness_.add_version(robot, 1);
  testing::play(harness_, file, {{"coulomb_friction", 0.6}}, 4, 21, start_us);
  serve();
  DiagnosisRequest wanted;
  wanted.robot_id = robot.robot_id;
  const auto id = service_->submit(wanted);
  ASSERT_TRUE(id) << describe(id.error());
  EXPECT_FALSE(service_->progress(*id)->started_utime_us);
  ASSERT_TRUE(service_->start());
  std::size_t seen = 0;
  for (auto progress = service_->progress(*id); progress; progress = service_->progress(*id)) {
    if (progress->state != DiagnosisState::running) continue;
    ++seen;
    ASSERT_EQ(progress->started_utime_us, 42);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_GT(seen, 0U);
}

class GapWatchTest : public DiagnosisServiceTest {
 protected:
  void watch(bool diagnose) {
    serve();
    WatchOptions options;
    options.diagnose = diagnose;
    watch_ = std::make_unique<GapWatch>(parts(drift_, 44), forecasts_, *service_, options);
  }

  std::vector<history::Event> events(const std::string& kind) {
    EXPECT_TRUE(writer_->flush());
    auto all = *harness_.store->events(0, 100);
    std::erase_if(all, [&](const history::Event& e) { return e.kind != kind; });
    return all;
  }
};

TEST_F(GapWatchTest, ReportsDriftAndItsCause) {
  const std::string_view file = virtual_robot::shipped_robots()[1].json_text;
  const auto robot = *robot::parse_robot(file);
  harness_.add_version(robot, 1);
  testing::play(harness_, file, {}, 8, 31, start_us);
  testing::play(harness_, file, {{"coulomb_friction", 0.6}}, 6, 32, start_us + 86'400'000'000);
  watch(true);
  ASSERT_TRUE(service_->start());
  watch_->look();
  const auto told = events("gap_drift");
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].robot_id, robot.robot_id);
  const json detail = json::parse(told[0].detail_json);
  EXPECT_EQ(detail["missions"], 6);
  EXPECT_GT(detail["ratio_after"].get<double>(), detail["ratio_before"].get<double>() + 0.03);
  const auto d = wait_for(detail["diagnosis_id"]);
  ASSERT_EQ(d.state, DiagnosisState::done) << d.error;
  EXPECT_EQ(d.cause, history::DiagnosisCause::watch);
  const auto diagnosed = events("gap_diagnosed");
  ASSERT_EQ(diagnosed.size(), 1U);
  EXPECT_EQ(json::parse(diagnosed[0].detail_json)["blames"], "wear") << diagnosed[0].detail_json;
  EXPECT_EQ(watch_->counts().drifting, 1U);
  watch_->look();
  EXPECT_EQ(events("gap_drift").size(), 1U);
  EXPECT_EQ(watch_->counts().rounds, 2U);
  service_.reset();
}

TEST_F(GapWatchTest, ReportsDeviatingSibling) {
  for (const char* id : {"a", "b", "c", "d", "x"}) {
    robot::RobotModel model = testing::nomad(), truth = nomad_with_friction(*id == 'c' ? 1.6 : 1.0);
    model.robot_id = truth.robot_id = id;
    if (*id == 'x') model.limits.payload_kg += 1;  // of another kind
    harness_.add_version(model, 1);
    for (int number = 0; number < 5; ++number) drive(harness_, truth, number);
  }
  watch(false);
  watch_->look();
  const auto told = events("gap_sibling");
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].robot_id, "c");
  watch_->look();
  EXPECT_EQ(events("gap_sibling").size(), 1U);
  EXPECT_EQ(watch_->counts().standing_out, 1U);

  const auto siblings = drift_.siblings("a");
  ASSERT_TRUE(siblings);
  EXPECT_EQ(siblings->size(), 4U);
  for (const drift::SiblingRatio& s : *siblings) EXPECT_EQ(s.stands_out, s.robot_id == "c") << s.robot_id;
  // The setting applies to all users of the view.
  DriftOptions loose;
  loose.settings.least_change = 1;
  const DriftView patient(*harness_.store, harness_.models, loose);
  EXPECT_TRUE(std::ranges::none_of(*patient.siblings("a"), &drift::SiblingRatio::stands_out));
}

TEST_F(GapWatchTest, AppliesLeastChangeEverywhere) {
  for (int number = 0; number < 16; ++number)
    drive(harness_, nomad_with_friction(number < 8 ? 1.0 : 1.6), number);
  const auto change = drift_.last_change("nomad", 1);
  ASSERT_TRUE(change) << describe(change.error());
  ASSERT_TRUE(*change);
  EXPECT_EQ(**change, drift_.marks("nomad")->back().utime_us);
  EXPECT_FALSE(*drift_.last_change("nomad", 2));  // another model resolves it

  DriftOptions loose;
  loose.settings.least_change = 1;
  const DriftView patient(*harness_.store, harness_.models, loose);
  EXPECT_TRUE(patient.marks("nomad")->empty());
  EXPECT_FALSE(*patient.last_change("nomad", 1));
  serve();
  GapWatch watch(parts(patient, 44), forecasts_, *service_, {});
  watch.look();
  EXPECT_EQ(watch.counts().drifting, 0U);
  EXPECT_TRUE(events("gap_drift").empty());
  EXPECT_TRUE(errors_.empty());
}

}  // namespace
}  // namespace joulecast::server
