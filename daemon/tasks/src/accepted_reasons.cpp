#include "abbe/tasks/accepted_reasons.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "abbe/config/gate_conditions.hpp"

namespace abbe::daemon {

Result<void> accept_also(const std::vector<std::string>& names, Config& config) {
  const auto known = gate_conditions();
  for (const std::string& name : names) {
    if (std::ranges::find(known, name) == known.end())
      return fail(ErrorCode::Usage,
                  fmt::format("accept \"{}\": must be {}", name, fmt::join(known, ", ")));
    if (!config.gate.accepts(name)) config.gate.accept.push_back(name);
  }
  return {};
}

}  // namespace abbe::daemon
