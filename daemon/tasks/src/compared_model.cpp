#include "abbe/tasks/compared_model.hpp"

#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::daemon {

Result<ComparedModel> compared_model(const std::string& name, const StoreOption& where) {
  auto found = found_model(name, where);
  ABBE_TRY(found);
  auto cautions = cautions_of(*found);
  auto machine = of_machine(name, *found).machine;
  return ComparedModel{name, std::move(found->document), std::move(cautions), std::move(machine)};
}

}  // namespace abbe::daemon
