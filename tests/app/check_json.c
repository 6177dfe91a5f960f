// check_json CHECK...: reads one JSON object from stdin and checks it.
//   path:number  path:integer  path:text  path:bool  path:object    member of that type
//   path<=x  path>=x                                                number within a bound
//   path=text                                                       text, or a number's value
// A path is keys joined by dots: probes.linear.mae_n. Exits with 1 and names what is wrong.
#include <cJSON.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char *read_stdin(void) {
  size_t used = 0, room = 1 << 16;
  char *text = malloc(room + 1);
  while (text) {
    used += fread(text + used, 1, room - used, stdin);
    if (used < room) break;
    room *= 2;
    char *grown = realloc(text, room + 1);
    if (!grown) free(text);
    text = grown;
  }
  if (text) text[used] = 0;
  return text;
}

static const cJSON *member(const cJSON *object, char *path) {
  for (char *key = strtok(path, "."); key && object; key = strtok(NULL, "."))
    object = cJSON_GetObjectItemCaseSensitive(object, key);
  return object;
}

static bool has_type(const cJSON *item, const char *type) {
  if (strcmp(type, "number") == 0) return cJSON_IsNumber(item);
  if (strcmp(type, "integer") == 0)
    return cJSON_IsNumber(item) && item->valuedouble == floor(item->valuedouble);
  if (strcmp(type, "text") == 0) return cJSON_IsString(item) && item->valuestring[0];
  if (strcmp(type, "bool") == 0) return cJSON_IsBool(item);
  if (strcmp(type, "object") == 0) return cJSON_IsObject(item);
  fprintf(stderr, "check_json: unknown type '%s'\n", type);
  return false;
}

static bool equals(const cJSON *item, const char *text) {
  if (cJSON_IsString(item)) return strcmp(item->valuestring, text) == 0;
  if (cJSON_IsBool(item)) return strcmp(cJSON_IsTrue(item) ? "true" : "false", text) == 0;
  return cJSON_IsNumber(item) && item->valuedouble == atof(text);
}

static bool holds(const cJSON *root, const char *check) {
  char path[256];
  size_t length = strcspn(check, ":<>=");
  if (length >= sizeof path || !check[length]) return false;
  memcpy(path, check, length);
  path[length] = 0;
  const char *rest = check + length;
  const cJSON *item = member(root, path);
  if (!item) return false;
  if (rest[0] == ':') return has_type(item, rest + 1);
  if (rest[0] == '=') return equals(item, rest + 1);
  if (rest[1] != '=' || !cJSON_IsNumber(item)) return false;
  double bound = atof(rest + 2);
  return rest[0] == '<' ? item->valuedouble <= bound : item->valuedouble >= bound;
}

int main(int argc, char **argv) {
  char *text = read_stdin();
  const char *end = NULL;
  cJSON *root = text ? cJSON_ParseWithOpts(text, &end, 1) : NULL;
  int wrong = 0;
  if (!cJSON_IsObject(root)) {
    fprintf(stderr, "not one JSON object: %s\n", text ? text : "");
    wrong = 1;
  }
  for (int i = 1; i < argc && cJSON_IsObject(root); ++i)
    if (!holds(root, argv[i])) {
      fprintf(stderr, "does not hold: %s\n", argv[i]);
      wrong = 1;
    }
  if (wrong && text) fprintf(stderr, "in: %s\n", text);
  cJSON_Delete(root);
  free(text);
  return wrong;
}
