#include "abbe/base/message.hpp"

#include <fmt/format.h>

#include <cstdio>

#include "abbe/protocol/printable.hpp"

namespace abbe::daemon {

void print_message(std::string_view program, std::string_view text) {
  fmt::print(stderr, "{}: {}\n", program, protocol::printable(text));
}

void print_error(std::string_view program, const Error& error) {
  print_message(program, error.text);
  for (const auto& detail : error.details)
    fmt::print(stderr, "  {}\n", protocol::printable(detail));
}

}  // namespace abbe::daemon
