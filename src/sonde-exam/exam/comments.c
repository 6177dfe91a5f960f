// Comments of a teacher: notes of the recording; RECORDING.comments.json of old ones.
// is_text:              UTF-8 without control characters but line ends and tabs.
// read_comment, read_all, load_file: the file of an old recording.
// take_notes:           those of a journal.
// write_all:            the file as a whole.
// sonde_comments_*:     the interface.
#include "sonde/exam_journal.h"
#include "sonde/exam_player.h"

#include "base/bounds.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

static const double longest_s = 1e6;

static char *path_of(const char *recording) {
  size_t bytes = strlen(recording) + sizeof ".comments.json";
  char *path = SONDE_NEW(char, bytes);
  if (path) snprintf(path, bytes, "%s.comments.json", recording);
  return path;
}

// Bytes of the character that starts here, 0 when none does.
static size_t character(const unsigned char *at) {
  size_t more = *at < 0x80 ? 0 : *at >= 0xc2 && *at < 0xe0 ? 1 : (*at & 0xf0) == 0xe0 ? 2 : 3;
  if (more == 0) return *at >= 0x20 || *at == '\n' || *at == '\t' ? *at != 0x7f : 0;
  if (more == 3 && (*at < 0xf0 || *at > 0xf4)) return 0;
  for (size_t k = 1; k <= more; ++k)
    if ((at[k] & 0xc0) != 0x80) return 0;
  bool overlong = (*at == 0xe0 && at[1] < 0xa0) || (*at == 0xf0 && at[1] < 0x90);
  bool beyond = (*at == 0xed && at[1] > 0x9f) || (*at == 0xf4 && at[1] > 0x8f);
  return overlong || beyond ? 0 : more + 1;
}

// Ends within `size` bytes, terminator included.
static bool is_text(const char *text, size_t size) {
  const char *end = memchr(text, 0, size);
  if (!end) return false;
  for (const char *at = text; at < end;) {
    size_t bytes = character((const unsigned char *)at);
    if (bytes == 0) return false;
    at += bytes;
  }
  return true;
}

// What is wrong, NULL: nothing.
static const char *fault_of(const sonde_comment *c) {
  if (!(c->time_s >= 0 && c->time_s <= longest_s)) return "has a time that is not one";
  if (!is_text(c->author, sizeof c->author)) return "has an author that is not text of 63 bytes";
  if (!is_text(c->text, sizeof c->text)) return "has a text that is not UTF-8 of 1023 bytes";
  return c->text[0] ? NULL : "has no text";
}

static void copy_text(const cJSON *object, const char *key, char *to, size_t size) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
  bool fits = cJSON_IsString(item) && strlen(item->valuestring) < size;
  if (fits)
    snprintf(to, size, "%s", item->valuestring);
  else
    memset(to, 0xff, size); // no text: fault_of() says so
}

static void read_comment(const cJSON *object, sonde_comment *comment) {
  const cJSON *time = cJSON_GetObjectItemCaseSensitive(object, "time_s");
  comment->time_s = cJSON_IsNumber(time) ? time->valuedouble : (double)NAN;
  copy_text(object, "author", comment->author, sizeof comment->author);
  copy_text(object, "text", comment->text, sizeof comment->text);
}

// Behind those of the same time.
static void insert(sonde_comments *comments, const sonde_comment *comment) {
  uint32_t at = comments->count;
  for (; at > 0 && comments->list[at - 1].time_s > comment->time_s; --at)
    comments->list[at] = comments->list[at - 1];
  comments->list[at] = *comment;
  comments->count++;
}

static sonde_status read_all(const char *path, const cJSON *root, sonde_comments *comments,
                             sonde_error *error) {
  const cJSON *list = cJSON_GetObjectItemCaseSensitive(root, "comments"), *item;
  int count = cJSON_GetArraySize(list), at = 0;
  if (!cJSON_IsArray(list) || count > SONDE_MAX_COMMENTS)
    return sonde_fail(error, SONDE_FORMAT, "%s: expected a list \"comments\" of at most %d", path,
                      SONDE_MAX_COMMENTS);
  cJSON_ArrayForEach(item, list) {
    sonde_comment comment;
    read_comment(item, &comment);
    const char *fault = fault_of(&comment);
    if (fault) return sonde_fail(error, SONDE_FORMAT, "%s: comment %d %s", path, at, fault);
    insert(comments, &comment);
    ++at;
  }
  return SONDE_OK;
}

// Those of a file from before version 8.
static sonde_status load_file(const char *recording, sonde_comments *comments, sonde_error *error) {
  char *path = path_of(recording), *bytes = NULL;
  size_t size = 0;
  cJSON *root = NULL;
  sonde_status status = path ? SONDE_OK : sonde_fail_memory(error);
  if (status || access(path, F_OK) != 0) goto done;
  status = sonde_bounded_load_text(path, &sonde_limits_json, &bytes, &size, error);
  if (!status) status = sonde_bounded_json(path, bytes, size, &sonde_limits_json, error);
  if (status) goto done;
  root = cJSON_ParseWithLength(bytes, size);
  if (root)
    status = read_all(path, root, comments, error);
  else
    status = sonde_fail(error, SONDE_FORMAT, "%s: is not a JSON object", path);
done:
  cJSON_Delete(root);
  sonde_free(bytes);
  sonde_free(path);
  return status;
}

// A comment of a journal that is not one is left out: the recording is whole without it.
static void take_notes(const sonde_notes *notes, sonde_comments *comments) {
  for (uint32_t i = 0; i < notes->count && comments->count < SONDE_MAX_COMMENTS; ++i) {
    sonde_comment comment;
    if (notes->list[i].kind != SONDE_NOTE_COMMENT) continue;
    cJSON *root = cJSON_Parse(notes->list[i].text);
    read_comment(root, &comment);
    if (!fault_of(&comment)) insert(comments, &comment);
    cJSON_Delete(root);
  }
}

sonde_status sonde_comments_load(const char *recording, sonde_comments *comments,
                                 sonde_error *error) {
  SONDE_ASSERT(recording != NULL && comments != NULL);
  *comments = (sonde_comments){.list = SONDE_NEW(sonde_comment, SONDE_MAX_COMMENTS + 1)};
  if (!comments->list) return sonde_fail_memory(error);
  sonde_notes notes = {0};
  sonde_status status = load_file(recording, comments, error);
  if (!status && access(recording, F_OK) == 0) {
    (void)sonde_notes_load(recording, &notes, NULL); // who plays the recording says what ails it
    take_notes(&notes, comments);
    sonde_notes_clear(&notes);
  }
  if (status) sonde_comments_clear(comments);
  return status;
}

static cJSON *item_of(const sonde_comment *comment) {
  cJSON *item = cJSON_CreateObject();
  cJSON_AddNumberToObject(item, "time_s", comment->time_s);
  cJSON_AddStringToObject(item, "author", comment->author);
  cJSON_AddStringToObject(item, "text", comment->text);
  return item;
}

char *sonde_comment_json(const sonde_comment *comment, sonde_error *error) {
  const char *fault = fault_of(comment);
  if (fault) {
    sonde_fail(error, SONDE_ARGUMENT, "the comment %s", fault);
    return NULL;
  }
  cJSON *item = item_of(comment);
  char *printed = cJSON_PrintUnformatted(item);
  size_t bytes = printed ? strlen(printed) + 1 : 0;
  char *text = printed ? SONDE_NEW(char, bytes) : NULL;
  if (text)
    memcpy(text, printed, bytes);
  else
    sonde_fail_memory(error);
  cJSON_free(printed);
  cJSON_Delete(item);
  return text;
}

static char *json_of(const sonde_comments *comments) {
  cJSON *root = cJSON_CreateObject(), *list = cJSON_AddArrayToObject(root, "comments");
  for (uint32_t k = 0; k < comments->count; ++k)
    cJSON_AddItemToArray(list, item_of(&comments->list[k]));
  char *text = cJSON_Print(root);
  cJSON_Delete(root);
  return text;
}

static sonde_status write_all(const char *recording, const sonde_comments *comments,
                              sonde_error *error) {
  char *path = path_of(recording), *text = json_of(comments);
  sonde_file *file = NULL;
  sonde_status status = path && text ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_printf(file, "%s\n", text);
    status = sonde_file_commit(file, error);
  }
  cJSON_free(text);
  sonde_free(path);
  return status;
}

// Into the journal; into a file of its own beside a recording from before version 8.
static sonde_status add_one(const char *recording, sonde_comments *comments,
                            const sonde_comment *comment, const char *text, sonde_error *error) {
  sonde_error own = {0};
  sonde_status status = sonde_notes_add(recording, SONDE_NOTE_COMMENT, text, &own);
  if (status == SONDE_VERSION) {
    insert(comments, comment);
    return write_all(recording, comments, error);
  }
  if (status && error) *error = own;
  return status;
}

sonde_status sonde_comments_add(const char *recording, const sonde_comment *comment,
                                sonde_error *error) {
  SONDE_ASSERT(recording != NULL && comment != NULL);
  sonde_comments comments = {0};
  sonde_error own = {0};
  char *text = sonde_comment_json(comment, &own);
  sonde_status status = text ? sonde_comments_load(recording, &comments, &own) : own.status;
  if (!status && comments.count >= SONDE_MAX_COMMENTS)
    status = sonde_fail(&own, SONDE_ARGUMENT, "%s has %d comments already", recording,
                        SONDE_MAX_COMMENTS);
  if (!status) status = add_one(recording, &comments, comment, text, &own);
  if (status && error) *error = own;
  sonde_comments_clear(&comments);
  sonde_free(text);
  return status;
}

void sonde_comments_clear(sonde_comments *comments) {
  sonde_free(comments->list);
  *comments = (sonde_comments){0};
}
