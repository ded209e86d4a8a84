#include "failing_new.h"

#include <dlfcn.h>
#include <execinfo.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <new>

namespace joulecast::testing {
namespace {

thread_local std::int64_t left = 0;
thread_local bool failed = false;

// The destructor of nlohmann::json allocates and cannot survive a failure.
bool is_destroying_json() {
  std::array<void*, 12> frames{};
  const int depth = backtrace(frames.data(), static_cast<int>(frames.size()));
  for (int k = 0; k < depth; ++k) {
    Dl_info info{};
    if (dladdr(frames[static_cast<std::size_t>(k)], &info) != 0 && info.dli_sname != nullptr &&
        std::strstr(info.dli_sname, "json_value7destroy") != nullptr)
      return true;
  }
  return false;
}

bool fails() {
  if (left == 0) return false;
  if (--left > 0) return false;
  if (is_destroying_json()) return false;
  failed = true;
  return true;
}

}  // namespace

void fail_allocation(std::int64_t count) {
  left = count;
  failed = false;
}

bool allocation_failed() {
  left = 0;
  return failed;
}

}  // namespace joulecast::testing

void* operator new(std::size_t size) {
  if (joulecast::testing::fails()) throw std::bad_alloc();
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return joulecast::testing::fails() ? nullptr : std::malloc(size > 0 ? size : 1);
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, const std::nothrow_t&) noexcept {
  std::free(memory);
}
