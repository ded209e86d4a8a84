// Help and completion of the command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>

#include "client/commands/help.h"
#include "client/commands/option.h"
#include "client/commands/table.h"
#include "client/wrapped.h"

namespace joulecast::client {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;

class CommandLine : public ::testing::Test {
 protected:
  CommandLine() : program_("joulecast", "joulecast") {
    program_.formatter(std::make_shared<HelpFormatter>(width));
    add_commands(program_, exit_);
    program_.require_subcommand(1);
    char folder[] = "/tmp/joulecast-completion-XXXXXX";
    EXPECT_NE(mkdtemp(folder), nullptr);
    before_ = std::filesystem::current_path();
    home_ = folder;
    std::filesystem::current_path(home_);
  }
  ~CommandLine() override {
    std::filesystem::current_path(before_);
    std::filesystem::remove_all(home_);
  }

  std::vector<std::string> complete(const std::vector<std::string>& words) {
    std::vector<std::string> texts;
    for (const Candidate& c : candidates(program_, words)) texts.push_back(c.text);
    return texts;
  }
  static void touch(const std::string& path) {
    if (const auto folder = std::filesystem::path(path).parent_path(); !folder.empty())
      std::filesystem::create_directories(folder);
    std::ofstream{path} << "x";
  }
  // Every command with its path, without the program's name.
  void each_command(const CLI::App& app,
                    const std::function<void(const CLI::App&, const std::string&)>& visit) {
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
      if (sub->get_name().empty()) continue;
      visit(*sub, command_path(*sub));
      each_command(*sub, visit);
    }
  }

  static constexpr std::size_t width = 90;
  Exit exit_ = Exit::ok;
  CLI::App program_;
  std::filesystem::path before_, home_;
};

TEST_F(CommandLine, CompletesCommandsAndSubcommands) {
  EXPECT_THAT(complete({"g"}), ElementsAre("gap"));
  EXPECT_THAT(complete({"calibrate", ""}), ElementsAre("drive", "battery"));
  EXPECT_THAT(complete({"gap", "tri"}), IsEmpty());
}

TEST_F(CommandLine, CompletesUnusedOptions) {
  EXPECT_THAT(complete({"profile", "--r"}),
              ElementsAre("--robot", "--robot-id", "--request", "--regeneration"));
  EXPECT_THAT(complete({"profile", "--robot", "amr.json", "--r"}), Not(Contains("--robot")));
  EXPECT_THAT(complete({"simulate", "--effect", "brush_drop=1", "--eff"}), ElementsAre("--effect"));
  EXPECT_THAT(complete({"token", "create", "--ro"}), ElementsAre("--role", "--robots"));
}

TEST_F(CommandLine, CompletesEnumerations) {
  EXPECT_THAT(complete({"autonomy", "--driving", ""}), ElementsAre("usual", "minimum_energy"));
  EXPECT_THAT(complete({"calibrate", "drive", "--method", ""}), ElementsAre("steady", "whole", "power"));
  EXPECT_THAT(complete({"missions", "--state", "in"}), ElementsAre("interrupted"));
  EXPECT_THAT(complete({"completion", ""}), IsSupersetOf({"bash", "zsh", "fish"}));
  EXPECT_THAT(complete({"token", "create", "--role", ""}), ElementsAre("read", "plan", "operate", "admin"));
}

TEST_F(CommandLine, CompletesEffectNames) {
  EXPECT_THAT(complete({"simulate", "--effect", ""}), Each(EndsWith("=")));
  EXPECT_THAT(complete({"simulate", "--effect", "coul"}), ElementsAre("coulomb_friction="));
  EXPECT_THAT(complete({"gap", "--effect", "coul"}), ElementsAre("coulomb_friction"));
  EXPECT_THAT(complete({"adopt", "--effect", "grad"}), ElementsAre("grade"));
  EXPECT_THAT(complete({"gap", "--effect", "x_"}), IsEmpty());  // of virtual robots only
}

TEST_F(CommandLine, CompletesFilesByKind) {
  for (const char* path :
       {"amr.json", "amr.lcmlog", "runs.csv", "robots/tug.json", "notes.txt", ".hidden.json"})
    touch(path);
  EXPECT_THAT(complete({"profile", "--robot", ""}), ElementsAre("amr.json", "robots/"));
  EXPECT_THAT(complete({"profile", "--robot", "robots/"}), ElementsAre("robots/tug.json"));
  EXPECT_THAT(complete({"gap", "a"}), ElementsAre("amr.lcmlog"));
  EXPECT_THAT(complete({"gap", "--robot", "amr.json", "--test", "amr.lcmlog", ""}),
              ElementsAre("amr.lcmlog", "robots/"));
  EXPECT_THAT(complete({"gap", "--missions", ""}), ElementsAre("robots/", "runs.csv"));
  EXPECT_THAT(complete({"import", ""}), ElementsAre("robots/", "runs.csv"));
}

TEST_F(CommandLine, CompletesNothingForFreeText) {
  EXPECT_THAT(complete({"profile", "--length", ""}), IsEmpty());
  EXPECT_THAT(complete({"profile", "--server", "http://127.0.0.1:1", "--robot-id", ""}),
              IsEmpty());  // no server
}

TEST_F(CommandLine, EveryOptionDocumentsItsValue) {
  each_command(program_, [](const CLI::App& app, const std::string& path) {
    for (const CLI::Option* option : app.get_options()) {
      if (option->get_group().empty()) continue;
      const std::string name = path + ' ' + option->get_name();
      EXPECT_NE(value_name(*option), "TEXT") << name;
      EXPECT_FALSE(option->get_description().empty()) << name;
    }
  });
}

TEST_F(CommandLine, HelpFitsTerminalWidth) {
  each_command(program_, [](const CLI::App& app, const std::string& path) {
    const std::string help = app.help("");
    EXPECT_THAT(help, HasSubstr("Usage: joulecast " + path));
    const std::string body = help.substr(0, help.find("Examples:"));
    std::istringstream lines(body.substr(0, body.find("Columns of")));
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), width) << line;
    EXPECT_THAT(help, Not(HasSubstr("Excludes:")));
  });
}

TEST_F(CommandLine, HelpOmitsHiddenParts) {
  each_command(program_, [](const CLI::App& app, const std::string& path) {
    if (!is_visible_command(&app)) return;
    const std::string help = app.help("");
    EXPECT_THAT(help, Not(HasSubstr("\n\n\n"))) << path;
    EXPECT_THAT(help, Not(HasSubstr("[...]"))) << path;
    const bool has_commands = !app.get_subcommands(is_visible_command).empty();
    EXPECT_EQ(help.find("COMMAND") != std::string::npos, has_commands) << path;
  });
}

// The message of wrong_use() for a command line.
class WrongUse : public CommandLine {
 protected:
  std::string told(std::vector<std::string> words) {
    std::reverse(words.begin(), words.end());
    try {
      program_.parse(std::move(words));
    } catch (const CLI::ParseError& error) {
      return wrong_use(program_, error);
    }
    return "nothing";
  }
};

TEST_F(WrongUse, SuggestsNearestOptionAndCommand) {
  EXPECT_EQ(told({"profile", "--robot", "a.json", "--lenght", "3"}),
            "joulecast profile: has no option --lenght; did you mean --length?\njoulecast profile --help "
            "lists the valid arguments\n");
  EXPECT_THAT(told({"profil", "--robot", "a.json"}),
              HasSubstr("joulecast: has no command profil; did you mean profile?"));
  EXPECT_THAT(told({"calibrate", "drvie"}),
              HasSubstr("joulecast calibrate: has no command drvie; did you mean drive?"));
  EXPECT_THAT(told({"effects", "all"}), HasSubstr("joulecast effects: does not accept all"));
  EXPECT_THAT(told({"profile", "--frobnicate"}), Not(HasSubstr("did you mean")));
}

TEST_F(WrongUse, NamesExpectedArguments) {
  EXPECT_THAT(told({"profile", "--robot"}), HasSubstr("--robot requires FILE"));
  EXPECT_THAT(told({"profile", "--robot", "a.json", "--length", "three"}),
              HasSubstr("--length requires NUMBER, not three"));
  EXPECT_THAT(told({"profile", "--robot", "a.json"}), HasSubstr("--length, --turn or --request"));
  EXPECT_THAT(told({"autonomy", "--robot", "a.json"}), HasSubstr("--charge"));
  EXPECT_THAT(told({"token", "create", "--days", "-1"}), HasSubstr("--days: must be 0 to 36500, not -1"));
  EXPECT_THAT(told({"calibrate", "drive", "--method", "slow"}),
              HasSubstr("must be one of {steady,whole,power}, not slow"));
  EXPECT_THAT(told({"calibrate"}), HasSubstr("requires a command: drive, battery"));
  for (const char* angle : {"90", "-45", "7"})
    EXPECT_THAT(told({"profile", "--robot", "a.json", "--turn", angle}),
                HasSubstr(std::string(angle) + "deg?"));
  for (const char* angle : {"90deg", "90rad", "-6.28", "1.57"})
    EXPECT_EQ(told({"profile", "--robot", "a.json", "--turn", angle}), "nothing") << angle;
}

TEST_F(WrongUse, NamesOptionOfInvalidTime) {
  EXPECT_THAT(told({"missions", "--server", "127.0.0.1:1", "--from", "yesterday"}),
              HasSubstr("--from: 'yesterday' is neither"));
}

TEST_F(WrongUse, RejectsCopiesOntoThemselves) {
  ::testing::internal::CaptureStderr();
  told({"store", "copy", "--from", "a.db", "--to", "a.db"});
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), HasSubstr("--to: is the store of --from"));
}

TEST_F(WrongUse, RequiresOneAlternative) {
  const std::vector<std::string> adopt{"adopt", "amr", "--server", "http://127.0.0.1:1"};
  EXPECT_THAT(told(adopt),
              HasSubstr("requires exactly one of --proposal, --diagnosis, --version, --model\n"));
  auto two = adopt;
  two.insert(two.end(), {"--version", "1", "--proposal", "2"});
  EXPECT_THAT(told(two), HasSubstr("requires exactly one of --proposal, --diagnosis, --version, --model\n"));
}

TEST_F(WrongUse, DaemonDiagnosesNoLogs) {
  EXPECT_THAT(told({"gap", "a.lcmlog", "b.lcmlog", "--server", "127.0.0.1:1"}),
              HasSubstr("--server excludes log"));
}

TEST_F(WrongUse, AcceptsRobotAsArgument) {
  for (const char* command : {"state", "proposals", "missions", "autonomy", "check", "gap"})
    for (const auto& robot :
         {std::vector<std::string>{"amr"}, std::vector<std::string>{"--robot-id", "amr"}}) {
      std::vector<std::string> words{command};
      words.insert(words.end(), robot.begin(), robot.end());
      words.insert(words.end(), {"--server", "http://127.0.0.1:1"});
      ::testing::internal::CaptureStderr();
      exit_ = Exit::ok;
      EXPECT_EQ(told(words), "nothing") << command;
      EXPECT_EQ(exit_, Exit::unreachable) << command;
      EXPECT_THAT(::testing::internal::GetCapturedStderr(), HasSubstr("127.0.0.1")) << command;
    }
}

TEST(Wrapped, KeepsWordsAndIndentsLines) {
  EXPECT_EQ(wrapped("one two three", 9), "one two\nthree");
  EXPECT_EQ(wrapped("one two three", 9, 2), "one two\n  three");
  EXPECT_EQ(wrapped("incomprehensibilities are long", 8), "incomprehensibilities\nare long");
  EXPECT_EQ(wrapped("first\nsecond", 20), "first\nsecond");
}

}  // namespace
}  // namespace joulecast::client
