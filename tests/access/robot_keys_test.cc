#include "access/robot_keys.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <span>
#include <string>

#include "access/sha256.h"

namespace joulecast::access {
namespace {

// RFC 4231, test cases 1 and 2.
TEST(Hmac, MatchesRfc4231Vectors) {
  const auto hex = [](const auto& mac) {
    return hexadecimal({reinterpret_cast<const char*>(mac.data()), mac.size()});
  };
  EXPECT_EQ(hex(hmac_sha256(std::string(20, '\x0b'), "Hi There")),
            "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
  EXPECT_EQ(hex(hmac_sha256("Jefe", "what do ya want for nothing?")),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

TEST(RobotKeys, RoundTripThroughFile) {
  const std::string path = ::testing::TempDir() + "robot_keys_" + std::to_string(getpid()) + ".json";
  const RobotKeys keys{{"amr-07", std::string(32, 'k')}, {"tug", std::string(31, '\0') + '\xff'}};
  ASSERT_TRUE(change_robot_keys(path, [&](RobotKeys& held) -> Result<void> {
    held = keys;
    return change_robot_keys(path, [](RobotKeys&) -> Result<void> { return {}; })
               ? invalid("", "two concurrent changes")
               : Result<void>();
  }));
  const auto read = read_robot_keys(path);
  ASSERT_TRUE(read) << describe(read.error());
  EXPECT_EQ(*read, keys);
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0640U);
  ASSERT_EQ(chmod(path.c_str(), 0644), 0);
  EXPECT_EQ(read_robot_keys(path).error().fault, Fault::invalid) << "readable by all users";
  std::filesystem::remove(path);
}

TEST(RobotKeys, FaultsNameTheField) {
  const std::string good(64, 'a');
  const auto fault = [](const std::string& text) {
    const auto keys = parse_robot_keys(text);
    return keys ? std::string("none") : keys.error().field;
  };
  EXPECT_EQ(fault(R"({"keys": [{"robot_id": "a", "key": ")" + good + R"("}]})"), "none");
  EXPECT_EQ(fault(R"({"keys": [{"robot_id": "a", "key": "ab"}]})"), "/keys/0/key");
  EXPECT_EQ(fault(R"({"keys": [{"robot_id": "a", "key": ")" + std::string(64, 'g') + R"("}]})"),
            "/keys/0/key");
  EXPECT_EQ(fault(R"({"keys": [{"robot_id": "a", "key": ")" + good + R"("}, {"robot_id": "a", "key": ")" +
                  good + R"("}]})"),
            "/keys/1/robot_id");
  EXPECT_EQ(fault(R"({"keys": {}})"), "/keys");
}

}  // namespace
}  // namespace joulecast::access
