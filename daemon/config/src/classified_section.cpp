#include "classified_section.hpp"

namespace abbe::daemon {

std::string ClassifiedSection::below(std::string_view key) const {
  return path_.empty() ? std::string{key} : fmt::format("{}.{}", path_, key);
}

std::vector<ClassifiedSection> ClassifiedSection::children(std::string_view key,
                                                           std::string_view label) {
  const auto name_in = [label](Section section) {
    const toml::node* name = section.node(label);
    return name == nullptr ? std::string{} : name->value_or(std::string{});
  };
  std::vector<ClassifiedSection> all;
  for (Section& section : section_.children(key)) {
    const std::string name = name_in(section);
    all.emplace_back(std::move(section), fmt::format("{}.{}", path_.empty() ? key : path_, name),
                     *meaning_);
  }
  return all;
}

bool ClassifiedSection::add(Key key, bool given, std::string value) {
  const bool has_meaning = key.role == Role::Reading || key.role == Role::Measurement;
  if (has_meaning && (given || !key.only_if_given)) state(key.role, key.name, std::move(value));
  return given;
}

void ClassifiedSection::state(Role role, std::string_view name, std::string value) {
  set_entry(role == Role::Reading ? meaning_->readings : meaning_->measurements, below(name),
            std::move(value));
}

}  // namespace abbe::daemon
