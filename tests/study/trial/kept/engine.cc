#include "tests/study/trial/kept/engine.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "base/json_number.h"

namespace joulecast::trial::kept {
namespace {

using nlohmann::json;

double number_or(const json& from, const char* key, double otherwise) {
  const auto at = from.find(key);
  return at != from.end() && at->is_number() ? at->get<double>() : otherwise;
}

std::string text_at(const json& from, const char* key) {
  const auto at = from.find(key);
  return at != from.end() && at->is_string() ? at->get<std::string>() : std::string();
}

std::optional<double> error_at(const json& from, const char* key) {
  const double value = number_or(from, key, -1);
  return value < 0 ? std::nullopt : std::optional(value);
}

json refusal(const std::string& why) {
  return {{"verdict", ""}, {"causes", json::array()}, {"refused", why}};
}

struct Ran {
  std::string output;
  int status = 0;
  double processor_s = 0;  // of the process and all that it waited for
};

double seconds_of(const timeval& t) {
  return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
}

// Runs `COMMAND LOG --robot FILE` by the shell and takes its standard output.
Result<Ran> run_command(const std::string& command, const std::string& log, const std::string& robot) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return fail(Fault::unavailable, "--engine", std::strerror(errno));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  std::string shell = "/bin/sh", option = "-c", script = command + " \"$0\" --robot \"$1\"";
  std::string first = log, second = robot;
  std::array<char*, 6> arguments{shell.data(), option.data(), script.data(),
                                 first.data(), second.data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawn(&child, shell.c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  Ran ran;
  std::array<char, 4096> block{};
  for (ssize_t n = 0;
       failed == 0 && ((n = read(ends[0], block.data(), block.size())) > 0 || (n < 0 && errno == EINTR));) {
    if (n > 0) ran.output.append(block.data(), static_cast<std::size_t>(n));
  }
  close(ends[0]);
  if (failed != 0) return fail(Fault::unavailable, "--engine", std::strerror(failed));
  rusage usage{};
  while (wait4(child, &ran.status, 0, &usage) < 0 && errno == EINTR) {
  }
  ran.processor_s = seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
  return ran;
}

}  // namespace

Result<EngineAnswer> parse_answer(std::string_view line) {
  const json from = json::parse(line, nullptr, false);
  if (!from.is_object() || !from.contains("verdict") || !from.contains("causes")) {
    return fail(Fault::corrupt, "answer", "is not an object with \"verdict\" and \"causes\"");
  }
  try {
    EngineAnswer answer;
    answer.verdict = from.at("verdict").get<std::string>();
    answer.verdict_probability = number_or(from, "verdict_probability", 0);
    answer.refused = text_at(from, "refused");
    answer.processor_s = number_or(from, "cpu_s", 0);
    for (const json& cause : from.at("causes")) {
      motion::NamedEffect effect;
      effect.id = cause.at("effect").get<std::string>();
      effect.probability = number_or(cause, "probability", 0);
      effect.strength = number_or(cause, "strength", 0);
      effect.deviation = number_or(cause, "sd", 0);
      effect.alternatives = cause.value("alternatives", std::vector<std::string>{});
      answer.effects.push_back(std::move(effect));
    }
    std::ranges::stable_sort(answer.effects, std::greater{}, &motion::NamedEffect::probability);
    const json none = json::object(), outside = from.value("outside", none),
               held_out = from.value("held_out", none);
    answer.outside_channel = text_at(outside, "channel");
    answer.outside_follows = text_at(outside, "follows");
    for (const json& c : from.value("corrections", json::array())) {
      answer.corrections.push_back(
          {text_at(c, "channel") + " " + text_at(c, "kind"), number_or(c, "probability", 1)});
    }
    answer.unchanged_error = error_at(held_out, "unchanged");
    answer.explanation_error = error_at(held_out, "explanation");
    answer.referee_error = error_at(held_out, "regression");
    return answer;
  } catch (const json::exception& e) {
    return fail(Fault::corrupt, "answer", e.what());
  }
}

json answer_line(const motion::Answer& answer) {
  json causes = json::array();
  for (const motion::NamedEffect& e : answer.effects) {
    causes.push_back({{"effect", e.id},
                      {"probability", e.probability},
                      {"strength", json_number(e.strength)},
                      {"sd", json_number(e.deviation)},
                      {"alternatives", e.alternatives}});
  }
  const auto error = [](const std::optional<double>& e) { return e ? json_number(*e) : json(); };
  json out{{"verdict", answer.verdict},
           {"verdict_probability", answer.verdict_probability},
           {"causes", causes},
           {"held_out",
            {{"unchanged", error(answer.unchanged_error)},
             {"explanation", error(answer.explanation_error)},
             {"regression", error(answer.referee_error)}}}};
  if (answer.verdict == "outside")
    out["outside"] = {{"channel", answer.outside_channel}, {"follows", answer.outside_follows}};
  if (!answer.refused.empty()) out["refused"] = answer.refused;
  return out;
}

Result<json> ask(const Engine& engine, const std::filesystem::path& log, const std::filesystem::path& robot) {
  if (engine.command.empty()) {
    const auto answer = motion::judge(log, robot);
    if (!answer) return tl::unexpected(answer.error());
    json line = answer_line(*answer);
    line["cpu_s"] = answer->processor_s;
    return line;
  }
  const auto ran = run_command(engine.command, log.string(), robot.string());
  if (!ran) return tl::unexpected(ran.error());
  json line;
  if (ran->status != 0) {
    line = refusal("the engine ended with the status " + std::to_string(WIFEXITED(ran->status)
                                                                            ? WEXITSTATUS(ran->status)
                                                                            : 128 + WTERMSIG(ran->status)));
  } else if (const auto answer = parse_answer(ran->output); !answer) {
    line = refusal(describe(answer.error()));
  } else {
    line = json::parse(ran->output);
  }
  line["cpu_s"] = ran->processor_s;
  return line;
}

}  // namespace joulecast::trial::kept
