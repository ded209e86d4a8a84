#pragma once

// The one door to Asio and Beast. <utility> comes first: Boost 1.74's awaitable.hpp uses std::exchange
// without including it. Only the .cc files of server/http and client/http_exchange.cc include this header; no
// other header of the project does, but for connection.h, which is private to this folder.
#include <utility>
// clang-format off
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
// clang-format on
