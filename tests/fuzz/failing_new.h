#pragma once

#include <cstdint>

// An operator new that fails when it is told to.
namespace joulecast::testing {

// Of this thread's allocations from now on the one of that number throws std::bad_alloc; 0: none.
void fail_allocation(std::int64_t number);

// Ends that, and says whether it came to it.
bool allocation_failed();

}  // namespace joulecast::testing
