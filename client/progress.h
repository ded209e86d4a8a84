#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace joulecast::client {

// A line on standard error that says how far long work has come: drawn over itself on a terminal, never
// written where standard error is a file or a pipe. It appears only when the work has taken a second, so
// short work leaves the terminal as it was, and it is gone when the object goes.
class Progress {
 public:
  // `work` names it ("replaying"); `unit` what is counted ("messages"); total 0 = not known beforehand.
  Progress(std::string work, std::string unit, std::uint64_t total = 0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Cheap enough for every step of a loop: the clock is asked once in 1024 calls of advance.
  void advance(std::uint64_t by = 1) {
    done_ += by;
    if ((++calls_ & 1023U) == 0) draw_if_due();
  }
  // For coarse steps: draws when the last drawing is older than a tenth of a second.
  void reach(std::uint64_t done) {
    done_ = done;
    draw_if_due();
  }
  void set_total(std::uint64_t total) { total_ = total; }
  // For work that reports its share done, 0 to 1, and asks whether to go on; the total is 100 then. Not to
  // outlive this.
  [[nodiscard]] std::function<bool(double)> shares() {
    return [this](double share) {
      reach(static_cast<std::uint64_t>(100 * share));
      return true;
    };
  }

 private:
  using Clock = std::chrono::steady_clock;
  void draw_if_due();

  std::string work_, unit_;
  std::uint64_t total_, done_ = 0, calls_ = 0;
  bool terminal_;
  bool drawn_ = false;
  Clock::time_point begin_ = Clock::now();
  Clock::time_point due_ = begin_ + std::chrono::seconds(1);
};

// The line's text for a terminal `width` columns wide, without control characters: a bar where the total is
// known, the rate, and the time left once it can be estimated.
[[nodiscard]] std::string progress_line(const std::string& work, const std::string& unit, std::uint64_t done,
                                        std::uint64_t total, double elapsed_s, int width);

}  // namespace joulecast::client
