#include <tinyxml2.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "abbe/base/text_file.hpp"
#include "abbe/messages/dds_security.hpp"

namespace abbe::daemon {
namespace {

using tinyxml2::XMLElement;

/// All children with the name `name` of the elements `of`.
std::vector<const XMLElement*> children(const std::vector<const XMLElement*>& of,
                                        const char* name) {
  std::vector<const XMLElement*> found;
  for (const XMLElement* parent : of)
    for (const auto* child = parent->FirstChildElement(name); child != nullptr;
         child = child->NextSiblingElement(name))
      found.push_back(child);
  return found;
}

bool is_abbe(const XMLElement* participant) {
  return participant->Attribute("profile_name", kDdsProfileName) != nullptr;
}

bool has_property(const XMLElement* participant, std::string_view name) {
  std::vector<const XMLElement*> level{participant};
  for (const char* below : {"rtps", "propertiesPolicy", "properties", "property", "name"})
    level = children(level, below);
  return std::ranges::any_of(level, [name](const XMLElement* e) {
    return e->GetText() != nullptr && e->GetText() == name;
  });
}

}  // namespace

bool dds_is_secured(const std::filesystem::path& security, const std::filesystem::path& profile) {
  if (!security.empty()) return true;
  const auto text = profile.empty() ? Result<std::string>{} : read_text(profile);
  tinyxml2::XMLDocument file;
  if (!text || file.Parse(text->data(), text->size()) != tinyxml2::XML_SUCCESS) return false;
  if (file.RootElement() == nullptr) return false;
  const std::vector<const XMLElement*> root{file.RootElement()};
  const bool profiles_only = root.front()->Name() == std::string_view{"profiles"};
  auto participants = children(profiles_only ? root : children(root, "profiles"), "participant");
  std::erase_if(participants, [](const XMLElement* p) { return !is_abbe(p); });

  // Without an authentication plugin Fast DDS switches security off, even if an access control
  // plugin is configured.
  return !participants.empty() && std::ranges::all_of(participants, [](const XMLElement* p) {
    return has_property(p, "dds.sec.auth.plugin") && has_property(p, "dds.sec.access.plugin");
  });
}

}  // namespace abbe::daemon
