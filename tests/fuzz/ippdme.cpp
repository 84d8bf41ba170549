// Any bytes as a server's stream, as a client's, as one response, one command, one list of
// arguments: nothing may read past an end, and views must lie within the line.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>

#include "abbe/protocol/ippdme/lines.hpp"

namespace {

using namespace abbe::protocol::ippdme;

void check(bool holds) {
  if (!holds) std::abort();
}

void inside(std::string_view part, std::string_view whole) {
  if (part.empty()) return;
  check(part.data() >= whole.data() && part.data() + part.size() <= whole.data() + whole.size());
}

void walk(std::string_view arguments) {
  ArgumentReader reader{arguments};
  while (const auto argument = reader.next()) {
    if (!*argument) {
      check(!reader.next());
      return;
    }
    inside((*argument)->text, arguments);
  }
}

void try_line(std::string_view line) {
  if (const auto response = parse_response(line)) {
    inside(response->data, line);
    inside(response->error.origin, line);
    inside(response->error.text, line);
    walk(response->data);
    (void)parse_point(response->data);
    check(to_string(response->tag) == line.substr(0, 5));
  }

  if (const auto command = parse_command(line)) {
    inside(command->method, line);
    inside(command->arguments, line);
    walk(command->arguments);
    (void)parse_point(command->arguments);
  }

  walk(line);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  try_line({reinterpret_cast<const char*>(data), size});
  static const auto framer = std::make_unique<LineFramer>();
  framer->reset();
  for (auto rest = bytes; !rest.empty();) {
    rest = rest.subspan(framer->push(rest.first(std::min<std::size_t>(rest.size(), 77))));
    while (const auto line = framer->next()) {
      if (!*line) return 0;
      try_line(**line);
    }
  }
  return 0;
}
