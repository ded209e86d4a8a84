#include "ingest/signature_gate.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/text_file.h"
#include "telemetry/codec.h"

namespace joulecast::ingest {
namespace {

constexpr std::int64_t now_us = 1'700'000'000'000'000;
constexpr const char* channel = "MISSION_EVENT.nomad";
const std::string gate_key(32, 'k');

class SignatureGateTest : public ::testing::Test {
 protected:
  SignatureGateTest() {
    EXPECT_TRUE(access::change_robot_keys(path_, [](access::RobotKeys& keys) -> Result<void> {
      keys = {{"nomad", gate_key}};
      return {};
    }));
  }
  ~SignatureGateTest() override { std::filesystem::remove(path_); }

  SignatureGate gate(bool required = false) {
    SignatureGate made({path_, required, 30'000'000});
    EXPECT_TRUE(made.read_keys());
    return made;
  }
  std::vector<std::uint8_t> signed_with(const std::string& with, std::int64_t sequence,
                                        std::int64_t utime_us = now_us, const char* on = channel) {
    return telemetry::sign(on, {utime_us, sequence, content_, {}}, with).value();
  }
  static std::string fate(SignatureGate& gate, std::span<const std::uint8_t> bytes,
                          std::string_view robot_id = "nomad", const char* on = channel) {
    const auto refusal = gate.check(on, robot_id, bytes, now_us);
    return refusal ? std::string(ingest_fault_names[static_cast<std::size_t>(refusal->fault)]) : "passes";
  }

  const std::string path_ = ::testing::TempDir() + "gate_keys_" + std::to_string(getpid()) + ".json";
  const std::vector<std::uint8_t> content_{1, 2, 3};
};

TEST_F(SignatureGateTest, KeyedRobotNeedsSignedMessages) {
  SignatureGate g = gate();
  EXPECT_EQ(fate(g, content_), "unsigned");
  EXPECT_EQ(fate(g, signed_with(gate_key, 1)), "passes");
  EXPECT_EQ(fate(g, signed_with(std::string(32, 'x'), 2)), "bad_signature");
  EXPECT_EQ(fate(g, signed_with(gate_key, 3, now_us, "MISSION_EVENT.other")), "bad_signature");
  EXPECT_EQ(fate(g, content_, "other", "MISSION_EVENT.other"), "passes");
}

TEST_F(SignatureGateTest, ForgedSequenceMovesNoWindow) {
  SignatureGate g = gate();
  EXPECT_EQ(fate(g, signed_with(std::string(32, 'x'), 1'000'000)), "bad_signature");
  EXPECT_EQ(fate(g, signed_with(gate_key, 1'000'000, now_us - 40'000'000)), "replayed");
  EXPECT_EQ(fate(g, signed_with(gate_key, 1)), "passes");
}

TEST_F(SignatureGateTest, RejectsReplaysNotReordering) {
  SignatureGate g = gate();
  for (const std::int64_t sequence : {100, 103, 101, 164, 102})
    EXPECT_EQ(fate(g, signed_with(gate_key, sequence)), "passes") << sequence;
  for (const std::int64_t sequence : {100, 101, 102, 103, 164, 99, -5})
    EXPECT_EQ(fate(g, signed_with(gate_key, sequence)), "replayed") << sequence;
  EXPECT_EQ(fate(g, signed_with(gate_key, INT64_MAX)), "passes");
  EXPECT_EQ(fate(g, signed_with(gate_key, INT64_MIN)), "replayed");
  for (const std::int64_t age_us : {-31'000'000, 31'000'000})
    EXPECT_EQ(fate(g, signed_with(gate_key, 200, now_us + age_us)), "replayed") << age_us;
}

TEST_F(SignatureGateTest, ChannelsCountApart) {
  SignatureGate g = gate();
  const char* other = "ROBOT_TELEMETRY.nomad";
  EXPECT_EQ(fate(g, signed_with(gate_key, 7)), "passes");
  EXPECT_EQ(fate(g, signed_with(gate_key, 7, now_us, other), "nomad", other), "passes");
}

TEST_F(SignatureGateTest, RequiredSigningRejectsKeylessRobots) {
  SignatureGate g = gate(true);
  EXPECT_EQ(fate(g, content_, "other", "MISSION_EVENT.other"), "unsigned");
  EXPECT_EQ(fate(g, signed_with(gate_key, 1, now_us, "MISSION_EVENT.other"), "other", "MISSION_EVENT.other"),
            "bad_signature");
  SignatureGate without({"", true, 30'000'000});
  EXPECT_EQ(without.read_keys().error().field, "ingest.require_signed");
}

TEST_F(SignatureGateTest, ReadsChangedFilesOnly) {
  SignatureGate g = gate();
  const auto change = [&](const std::string& text) {
    ASSERT_TRUE(write_text_file(path_, text, Existing::replace));
    usleep(1'100'000);
  };
  change("no keys");
  EXPECT_FALSE(*g.refresh());
  EXPECT_EQ(fate(g, signed_with(gate_key, 1)), "passes");
  change(access::to_json_text({{"nomad", std::string(32, 'n')}}));
  EXPECT_TRUE(*g.refresh());
  EXPECT_EQ(fate(g, signed_with(gate_key, 2)), "bad_signature");
  EXPECT_EQ(fate(g, signed_with(std::string(32, 'n'), 3)), "passes");
  for (const auto& [mode, is_read] : {std::pair{0602U, false}, {0600U, true}}) {
    ASSERT_EQ(chmod(path_.c_str(), mode), 0);
    usleep(1'100'000);
    EXPECT_EQ(g.refresh()->has_value(), is_read);
  }
}

TEST_F(SignatureGateTest, ChangedKeyBeginsNewWindow) {
  SignatureGate g = gate();
  EXPECT_EQ(fate(g, signed_with(gate_key, 41)), "passes");
  EXPECT_EQ(fate(g, signed_with(gate_key, INT64_MAX)), "passes");  // the key has leaked
  EXPECT_EQ(fate(g, signed_with(gate_key, 42)), "replayed");
  const std::string fresh(32, 'n');
  EXPECT_TRUE(access::change_robot_keys(path_, [&](access::RobotKeys& keys) -> Result<void> {
    keys = {{"nomad", fresh}};
    return {};
  }));
  ASSERT_TRUE(g.read_keys());
  EXPECT_EQ(fate(g, signed_with(gate_key, INT64_MAX)), "bad_signature");
  EXPECT_EQ(fate(g, signed_with(fresh, 42)), "passes");
  EXPECT_EQ(fate(g, signed_with(fresh, 42)), "replayed");
}

}  // namespace
}  // namespace joulecast::ingest
