import js from '@eslint/js';
import globals from 'globals';

// The page's sources run in a browser; its build and its tests run in node, and parts of the tests in both.
export default [
  { ignores: ['**/node_modules/', 'server/web/*.js', 'deploy/import/*.cjs'] },
  js.configs.recommended,
  {
    languageOptions: { parserOptions: { ecmaFeatures: { jsx: true } } },
    rules: {
      // The service's fields keep their names; everything else is camelCase.
      camelcase: ['error', { properties: 'never', ignoreDestructuring: true }],
      eqeqeq: 'error',
      'max-len': [
        'error',
        { code: 110, ignoreStrings: true, ignoreTemplateLiterals: true, ignorePattern: '^\\s*[^ ]+$' },
      ],
      'no-unused-vars': ['error', { args: 'after-used', caughtErrors: 'none' }],
      'no-var': 'error',
      'one-var': ['error', 'never'],
      'prefer-const': 'error',
      complexity: ['error', 26],
    },
  },
  { files: ['server/web/source/**/*.{js,jsx}'], languageOptions: { globals: globals.browser } },
  { files: ['server/web/*.mjs', 'deploy/import/**'], languageOptions: { globals: globals.node } },
  {
    files: ['tests/web/**', 'tests/import/**'],
    languageOptions: { globals: { ...globals.node, ...globals.browser } },
  },
];
