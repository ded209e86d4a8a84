#pragma once

#include <tl/expected.hpp>
#include <utility>

// Forwarding of the error of a Result, in a function that returns a Result.

// Returns the error of the expression, if it has one; its value is dropped.
#define TRY(...)                                                           \
  do {                                                                     \
    if (auto&& tried = (__VA_ARGS__); !tried)                              \
      return tl::unexpected(std::forward<decltype(tried)>(tried).error()); \
  } while (false)

// Initializes the declaration with the value of the expression, or returns the expression's error:
// TRY_ASSIGN(const auto robot, load_robot(file));
#define TRY_ASSIGN(declaration, ...) TRY_ASSIGN_AT(__LINE__, declaration, __VA_ARGS__)
#define TRY_ASSIGN_AT(line, declaration, ...) TRY_ASSIGN_ON(line, declaration, __VA_ARGS__)
#define TRY_ASSIGN_ON(line, declaration, ...) TRY_ASSIGN_NAMED(tried_##line, declaration, __VA_ARGS__)
#define TRY_ASSIGN_NAMED(tried, declaration, ...)                                  \
  auto&& tried = (__VA_ARGS__);                                                    \
  if (!tried) return tl::unexpected(std::forward<decltype(tried)>(tried).error()); \
  declaration = *std::forward<decltype(tried)>(tried)
