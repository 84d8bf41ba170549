# The filter between the socket and Fast DDS, also compiled into the example of a subscriber.
set(ABBE_DDS_FILTER_SOURCES)
foreach(name announced_values announcement_check filter_transport fragment_reassembly message_filter
        protected_structure sequence_window submessage)
  list(APPEND ABBE_DDS_FILTER_SOURCES ${CMAKE_CURRENT_LIST_DIR}/src/${name}.cpp)
endforeach()
