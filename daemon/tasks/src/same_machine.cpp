#include "abbe/tasks/same_machine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/base/printable.hpp"
#include "abbe/model/machine_identity.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

OfMachine of_machine(const std::string& name, const FoundModel& model) {
  const auto& machine = model.document.machine;
  return {name, model.identity_doubt == kOfOtherMachine
                    ? machine + " (from which the data folder was copied)"
                    : machine};
}

std::string different_machines(std::span<const OfMachine> compared) {
  const auto other = std::ranges::find_if(
      compared, [&](const OfMachine& one) { return one.machine != compared.front().machine; });
  if (other == compared.end()) return {};
  return printable_line(fmt::format("different machines: {} is of machine \"{}\", {} of \"{}\"",
                                    compared.front().what, compared.front().machine, other->what,
                                    other->machine));
}

Result<std::string> require_same_machine(const std::string& command,
                                         std::span<const OfMachine> compared, bool other_machine) {
  std::string different = different_machines(compared);
  if (!different.empty() && !other_machine)
    return fail(ErrorCode::Usage,
                fmt::format("{}: {}; if this is meant, give --other-machine", command, different));
  return different;
}

Result<ComparedModel> compared_model(const std::string& name, const StoreOption& where) {
  auto found = found_model(name, where);
  ABBE_TRY(found);
  auto cautions = cautions_of(*found);
  auto machine = of_machine(name, *found).machine;
  return ComparedModel{name, std::move(found->document), std::move(cautions), std::move(machine)};
}

}  // namespace abbe::daemon
