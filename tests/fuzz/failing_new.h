#pragma once

#include <cstdint>

// An operator new that fails on request.
namespace joulecast::testing {

// The allocation of this number from now on in this thread throws std::bad_alloc; 0: none does.
void fail_allocation(std::int64_t number);

// Cancels the failure; true if it has occurred.
bool allocation_failed();

}  // namespace joulecast::testing
