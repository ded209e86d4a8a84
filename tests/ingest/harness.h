#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "history/open_store.h"
#include "ingest/pipeline.h"
#include "robot/robot_file.h"

namespace joulecast::testing {

// A folder of its own that goes with the object.
class TemporaryFolder {
 public:
  TemporaryFolder()
      : path_(std::filesystem::temp_directory_path() /
              ("joulecast-" + std::to_string(std::random_device{}()))) {
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// The pipeline on a store in a temporary folder; commands are applied immediately instead of by a writer
// thread.
class PipelineHarness {
 public:
  explicit PipelineHarness(ingest::SessionSettings settings = {}) : settings_(settings) { restart(); }

  // As if the daemon was killed (nothing is flushed) and started again on the same store.
  void restart() {
    pipeline.reset();
    store.reset();
    auto opened = history::open_store(folder_.file("history.db"));
    if (!opened) throw std::runtime_error(describe(opened.error()));
    store = std::move(*opened);
    pipeline = std::make_unique<ingest::Pipeline>(
        settings_, 100, models,
        ingest::SessionOutputs{
            *store,
            [this](history::Command command) { apply(std::move(command)); },
            fleet,
            counters,
            [this](const std::string&, const std::string& text) { warnings.push_back(text); },
            {},
            [this](const std::string&) { return last_change; },
            [this](history::Proposal candidate) { candidates.push_back(std::move(candidate)); }});
    if (auto recovered = pipeline->recover(); !recovered)
      throw std::runtime_error(describe(recovered.error()));
  }

  void add_robot(const robot::RobotModel& robot) { add_version(robot, 1); }
  void add_version(const robot::RobotModel& robot, std::int64_t version) {
    apply(history::AddModel{robot.robot_id, 1, history::ModelOrigin::file, "", robot::to_json_text(robot),
                            std::nullopt});
    ASSERT_TRUE(models.put(robot, version));
  }

  std::vector<history::Mission> missions() {
    auto page = store->missions({}, {.limit = 1000, .cursor = {}});
    EXPECT_TRUE(page) << (page ? "" : describe(page.error()));
    std::vector<history::Mission> found = page ? page->missions : std::vector<history::Mission>{};
    std::reverse(found.begin(), found.end());
    return found;
  }

  std::uint64_t faults(ingest::IngestFault fault) const {
    return counters.faults[static_cast<std::size_t>(fault)];
  }

  ingest::ModelRegistry models;
  ingest::FleetView fleet;
  ingest::IngestCounters counters;
  std::vector<std::string> warnings;
  std::optional<drift::Mark> last_change;     // as the watch of the gap would tell sessions
  std::vector<history::Proposal> candidates;  // that sessions suggested
  std::unique_ptr<history::Store> store;
  std::unique_ptr<ingest::Pipeline> pipeline;

 private:
  void apply(history::Command command) {
    const auto applied = store->apply({&command, 1});
    ASSERT_TRUE(applied) << describe(applied.error());
    ASSERT_TRUE(applied->front()) << describe(applied->front().error());
    if (const auto* begun = std::get_if<history::StartMission>(&command); begun && *applied->front() > 0)
      ingest::report_reused_name(begun->mission, *applied->front(), begun->mission.start_utime_us, counters,
                                 [this](history::Command event) { apply(std::move(event)); });
  }

  TemporaryFolder folder_;
  ingest::SessionSettings settings_;
};

}  // namespace joulecast::testing
