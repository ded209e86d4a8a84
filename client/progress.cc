#include "client/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "client/wrapped.h"

namespace joulecast::client {
namespace {

std::string clock_text(double seconds) {
  const auto whole = static_cast<long>(std::ceil(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{}:{:02} min", whole / 60, whole % 60);
  return fmt::format("{}:{:02} h", whole / 3600, whole % 3600 / 60);
}

}  // namespace

std::string progress_line(const std::string& work, const std::string& unit, std::uint64_t done,
                          std::uint64_t total, double elapsed_s, std::size_t width) {
  std::string line = work + ' ';
  if (total > 0) {
    const double part = std::min(1.0, static_cast<double>(done) / static_cast<double>(total));
    constexpr int cells = 24;
    const int full = static_cast<int>(part * cells);
    line += fmt::format("[{:=<{}}{: <{}}] {:3.0f} %", "", full, "", cells - full, 100 * part);
    if (unit != "%") line += fmt::format("  {} of {} {}", done, total, unit);
    // During the first hundredth the rate is a poor estimate of the remaining time.
    if (part > 0.01 && part < 1) line += ", " + clock_text(elapsed_s * (1 - part) / part) + " left";
  } else {
    line += fmt::format("{} {}", done, unit);
    if (elapsed_s > 0) line += fmt::format(", {:.0f} a second", static_cast<double>(done) / elapsed_s);
  }
  if (line.size() >= width) line.resize(std::max<std::size_t>(width, 2) - 1);
  return line;
}

Progress::Progress(std::string work, std::string unit, std::uint64_t total)
    : work_(std::move(work)), unit_(std::move(unit)), total_(total), terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (drawn_) std::fputs("\r\033[K", stderr);
}

void Progress::draw_if_due() {
  if (!terminal_) return;
  const auto now = Clock::now();
  if (now < due_) return;
  due_ = now + std::chrono::milliseconds(100);
  drawn_ = true;
  const double elapsed_s = std::chrono::duration<double>(now - begin_).count();
  const auto line =
      progress_line(work_, unit_, done_, total_, elapsed_s, terminal_columns(STDERR_FILENO, 80));
  std::fprintf(stderr, "\r\033[K%s", line.c_str());
  std::fflush(stderr);
}

}  // namespace joulecast::client
