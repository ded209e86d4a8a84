#pragma once

#include <exception>
#include <functional>
#include <string_view>

namespace joulecast {

// Called for every exception that a part of the program survived, on the part's thread.
using FaultObserver = std::function<void(std::string_view part, std::string_view why)>;
void observe_faults(FaultObserver observer);

// Calls the observer; throws nothing.
void report_fault(std::string_view part, std::string_view why) noexcept;

// The boundary that every long-lived thread has around a turn of its loop: an exception, out of memory for
// one, is reported and costs that turn and not the process. False when there was one.
template <class Work>
bool survive(std::string_view part, Work&& work) noexcept {
  try {
    work();
    return true;
  } catch (const std::exception& error) {
    report_fault(part, error.what());
  } catch (...) {
    report_fault(part, "an exception of unknown type");
  }
  return false;
}

}  // namespace joulecast
