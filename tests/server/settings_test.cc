#include "server/settings.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

namespace joulecast {
namespace {

using Texts = std::vector<std::string>;

class SettingsTest : public ::testing::Test {
 protected:
  ~SettingsTest() override { std::filesystem::remove(file_); }
  std::string write(const std::string& text) {
    std::ofstream(file_) << text;
    return file_;
  }
  static Error fault(const Texts& arguments, const Texts& environment = {}) {
    const auto result = read_settings(arguments, environment);
    return result ? Error{} : result.error();
  }
  std::string file_ =
      (std::filesystem::temp_directory_path() /
       ("joulecast-settings-" + std::to_string(::testing::UnitTest::GetInstance()->random_seed()) + "-" +
        std::to_string(reinterpret_cast<std::uintptr_t>(this)) + ".json"))
          .string();
};

TEST_F(SettingsTest, DefaultsAreValid) {
  std::set<std::string> flags;
  std::set<std::string> variables;
  for (const Setting& setting : settings_table()) {
    Settings settings;
    const auto set = settings.set(setting.key, setting.default_value(), Origin::flag, setting.key);
    EXPECT_TRUE(set.has_value()) << (set ? "" : describe(set.error()));
    EXPECT_FALSE(setting.help.empty()) << setting.key;
    EXPECT_TRUE(flags.insert(setting.flag()).second) << setting.flag();
    EXPECT_TRUE(variables.insert(setting.environment()).second) << setting.environment();
  }
}

TEST_F(SettingsTest, AppliesSourcesByPrecedence) {
  const std::string file = write(R"({"http": {"port": 1001, "worker_threads": 3, "address": "::1"}})");
  const Texts variables{"JOULECAST_HTTP_PORT=1002", "JOULECAST_HTTP_WORKER_THREADS=4", "PATH=/bin"};
  const auto all = read_settings({"--config", file, "--http-port=1003"}, variables);
  ASSERT_TRUE(all.has_value()) << describe(all.error());
  EXPECT_EQ(all->settings.options().http.port, 1003);
  EXPECT_EQ(all->settings.origin("http.port"), Origin::flag);
  EXPECT_EQ(all->settings.options().http.worker_threads, 4u);
  EXPECT_EQ(all->settings.origin("http.worker_threads"), Origin::environment);
  EXPECT_EQ(all->settings.options().http.address, "::1");
  EXPECT_EQ(all->settings.origin("http.address"), Origin::file);
  EXPECT_EQ(all->settings.options().store_path, "joulecast.db");
  EXPECT_EQ(all->settings.origin("store.path"), Origin::default_value);
  EXPECT_EQ(all->action, Invocation::Action::run);
}

TEST_F(SettingsTest, FlagOverridesEnvironmentFile) {
  const std::string file = write(R"({"$schema": "config.schema.json", "log": {"format": "json"}})");
  EXPECT_EQ(read_settings({}, {"JOULECAST_CONFIG=" + file}).value().settings.options().log_format,
            LogFormat::json);
  EXPECT_EQ(fault({"--config", "/nonexistent/joulecastd.json"}, {"JOULECAST_CONFIG=" + file}).fault,
            Fault::not_found);
}

TEST_F(SettingsTest, UnknownKeysSuggestNearest) {
  EXPECT_EQ(fault({"--http-prot", "1"}).field, "--http-prot");
  EXPECT_EQ(fault({"--http-prot", "1"}).message, "unknown flag; did you mean --http-port?");
  EXPECT_EQ(fault({}, {"JOULECAST_HTTP_PROT=1"}).field, "JOULECAST_HTTP_PROT");
  EXPECT_NE(fault({}, {"JOULECAST_HTTP_PROT=1"}).message.find("JOULECAST_HTTP_PORT"), std::string::npos);
  const Error in_file = fault({"--config", write(R"({"http": {"prot": 1}})")});
  EXPECT_NE(in_file.field.find("http.prot"), std::string::npos);
  EXPECT_NE(in_file.message.find("http.port"), std::string::npos);
  EXPECT_EQ(fault({"qqqqqqqqqqqqqqqqqqq"}).message, "unknown flag");  // no similar name
  EXPECT_NE(fault({"--config", write(R"({"htp": {"port": 1}})")}).message.find("unknown"), std::string::npos);
}

TEST_F(SettingsTest, ChecksTypesAndBounds) {
  EXPECT_EQ(fault({"--http-port", "65536"}).message, "is 65536, must be at least 0 and at most 65535");
  EXPECT_EQ(fault({"--http-port", "80x"}).message, "must be an integer, is \"80x\"");
  EXPECT_EQ(fault({"--http-port", ""}).field, "--http-port");
  EXPECT_EQ(fault({"--http-read-timeout-s", "nan"}).message, "must be a finite number, is \"nan\"");
  EXPECT_EQ(fault({"--ingest-implicit-missions", "yes"}).message, "must be true or false, is \"yes\"");
  EXPECT_EQ(fault({"--log-format", "xml"}).message, "must be one of text|json, is \"xml\"");
  EXPECT_EQ(fault({}, {"JOULECAST_HTTP_READ_TIMEOUT_S=0"}).field, "JOULECAST_HTTP_READ_TIMEOUT_S");
  EXPECT_EQ(fault({"--http-port"}).message, "needs a value");
  EXPECT_EQ(fault({"--http-port", "1", "--http-port", "2"}).message, "is given more than once");
  for (const char* text :
       {R"({"http": {"port": "8080"}})", R"({"http": {"port": 80.5}})", R"({"http": {"port": 1e3}})",
        R"({"http": 80})", R"([])", R"({"http": {"port": 1, "port": 2}})", R"({"http": )",
        R"({"ingest": {"implicit_missions": 1}})", R"({"http": {"port": 99999999999999999999}})"}) {
    EXPECT_EQ(fault({"--config", write(text)}).fault, Fault::invalid) << text;
    EXPECT_FALSE(fault({"--config", write(text)}).message.empty()) << text;
  }
}

TEST_F(SettingsTest, ReportsEveryFaultyValue) {
  const std::string file = write(R"({"http": {"port": -1, "prot": 1}, "log": {"level": "loud"}})");
  const std::string all =
      describe(fault({"--config", file, "--http-worker-threads", "0"}, {"JOULECAST_LCM_ULR=x"}));
  for (const char* name :
       {"http.port", "http.prot", "log.level", "--http-worker-threads", "JOULECAST_LCM_ULR"})
    EXPECT_NE(all.find(name), std::string::npos) << name << " is not in:\n" << all;
  EXPECT_EQ(std::count(all.begin(), all.end(), '\n'), 4) << all;
}

TEST_F(SettingsTest, IgnoresCommandLineVariables) {
  for (const char* name : {"SERVER", "TOKEN", "CLIENT_CERTIFICATE", "CLIENT_KEY"})
    EXPECT_TRUE(read_settings({}, {std::string("JOULECAST_") + name + "=x"})) << name;
}

TEST_F(SettingsTest, ParsesCommands) {
  using Action = Invocation::Action;
  EXPECT_EQ(read_settings({"--help"}, {}).value().action, Action::help);
  EXPECT_EQ(read_settings({"--print-config", "--http-port", "9"}, {}).value().settings.options().http.port,
            9);
  EXPECT_EQ(read_settings({"--check-config"}, {}).value().action, Action::check_config);
  EXPECT_EQ(fault({"--check-config", "--version"}).field, "--version");
  EXPECT_EQ(fault({"--check-config", "--http-port", "70000"}).field, "--http-port");
}

TEST_F(SettingsTest, PrintsValuesWithOrigin) {
  const auto invocation = read_settings({"--http-port", "9"}, {"JOULECAST_LOG_LEVEL=debug"}).value();
  std::istringstream lines(invocation.settings.print());
  std::size_t count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    if (line.starts_with("http.port = 9 ")) {
      EXPECT_NE(line.find("# flag"), std::string::npos);
    }
    if (line.starts_with("log.level = \"debug\" ")) {
      EXPECT_NE(line.find("# environment"), std::string::npos);
    }
  }
  EXPECT_EQ(count, settings_table().size());
  for (const Setting& setting : settings_table()) {
    EXPECT_NE(settings_help().find(setting.flag() + " "), std::string::npos) << setting.flag();
  }
}

TEST_F(SettingsTest, CommittedSchemaMatchesTable) {
  std::ifstream file(JOULECAST_SOURCE_DIR "/schemas/config.schema.json");
  std::ostringstream committed;
  committed << file.rdbuf();
  EXPECT_EQ(committed.str(), settings_schema()) << "regenerate: joulecastd --print-config-schema";
}

// Every kind of member takes its value in the unit of its key and prints it again.
TEST_F(SettingsTest, SetsMembersOfEachKind) {
  const auto read = read_settings({"--http-allowed-hosts",
                                   "a,b",
                                   "--watch-robots",
                                   "amr-2,amr-1",
                                   "--http-read-timeout-s",
                                   "2.5",
                                   "--ingest-reorder-s",
                                   "0.25",
                                   "--store-retention-days",
                                   "0",
                                   "--store-retention-bytes",
                                   "12",
                                   "--meter-tolerance",
                                   "1e-5",
                                   "--mqtt-dialect",
                                   "vda5050-2.1",
                                   "--store-synchronous",
                                   "normal",
                                   "--watch-diagnose",
                                   "false",
                                   "--log-level",
                                   "error"},
                                  {});
  ASSERT_TRUE(read.has_value()) << describe(read.error());
  const DaemonOptions& o = read->settings.options();
  EXPECT_EQ(o.http.allowed_hosts, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(o.watch.robots, (std::set<std::string>{"amr-1", "amr-2"}));
  EXPECT_EQ(o.http.read_timeout.count(), 2500);
  EXPECT_EQ(o.ingest.session.reorder_us, 250'000);
  EXPECT_EQ(o.writer.retention.telemetry_max_age_us, std::nullopt);
  EXPECT_EQ(o.writer.retention.telemetry_max_bytes, 12);
  EXPECT_EQ(o.ingest.session.meter.tolerance, 1e-5);
  EXPECT_EQ(o.mqtt.dialect, answers::Dialect::vda5050_2_1);
  EXPECT_EQ(o.store.durability, history::Durability::process_end);
  EXPECT_FALSE(o.watch.diagnose);
  EXPECT_EQ(o.log_level, LogLevel::error);
  for (const char* line :
       {"http.allowed_hosts = \"a,b\"", "watch.robots = \"amr-1,amr-2\"", "http.read_timeout_s = 2.5 ",
        "ingest.reorder_s = 0.25 ", "store.retention_days = 0 ", "store.retention_bytes = 12 ",
        "mqtt.dialect = \"vda5050-2.1\"", "store.synchronous = \"normal\"", "watch.diagnose = false "})
    EXPECT_NE(read->settings.print().find(line), std::string::npos) << line << read->settings.print();
}

TEST(CheckConfig, ReportsUnusableAddresses) {
  DaemonOptions options;
  options.http.address = "localhost";
  options.http.trusted_proxies = {"proxy"};
  options.ingest.lcm_url = "udpm://10.0.0.1:7667";
  options.ingest.listen.interface_address = "eth0";
  std::vector<std::string> fields;
  for (const Error& fault : faults_of(options)) {
    fields.push_back(fault.field);
    if (fault.field != "http.address") continue;
    EXPECT_EQ(fault.message, "must be an IPv4 or IPv6 address, is localhost");
  }
  for (const char* field : {"http.address", "http.trusted_proxies", "lcm.url", "lcm.bind_address"})
    EXPECT_EQ(std::ranges::count(fields, field), 1) << field;
}

TEST(CheckConfig, ReportsUnusableFilesAndHosts) {
  for (const char* host : {"https://fleet.example", "fleet.example:8443", "*.example"}) {
    DaemonOptions options;
    options.http.allowed_hosts = {"*", "::1", host};
    options.web_directory = options.webhooks_file = options.mqtt.broker.authorities = "/nonexistent";
    options.mqtt_url = "mqtts://broker";
    std::vector<std::string> fields;
    for (const Error& fault : faults_of(options)) {
      fields.push_back(fault.field);
      EXPECT_NE(fault.message.find(fault.field == "http.allowed_hosts" ? host : "/nonexistent"),
                std::string::npos)
          << fault.message;
    }
    EXPECT_EQ(fields, (std::vector<std::string>{"http.allowed_hosts", "http.web_directory", "webhooks.file",
                                                "mqtt.authorities"}));
  }
}

}  // namespace
}  // namespace joulecast
