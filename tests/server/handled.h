#pragma once

#include <utility>

#include "server/http/router.h"

namespace joulecast::http {

// match() and run() in one.
inline Response handled(const Router& router, Request& request) {
  Router::Match match = router.match(request);
  return match.answer ? std::move(*match.answer) : router.run(*match.endpoint, request);
}

}  // namespace joulecast::http
